"""What is modelled: motion, features, sensors and internal measurements, each a value."""
