"""EKF-SLAM as a library: models, filter, sources of data and sessions; complete without a page."""
