"""Where frames come from: simulated worlds, images and recorded logs."""

import cv2

# The patches and pictures are small: a second thread costs more to wake than it saves, and it would
# take the core that the page draws on.
cv2.setNumThreads(1)
