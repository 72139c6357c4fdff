"""Laws of the filter."""
