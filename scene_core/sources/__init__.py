"""Where frames come from: simulated worlds, images and recorded logs."""
