"""The extended Kalman filter and the phases of its frame."""
