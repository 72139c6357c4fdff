"""Speed figures: `make bench`. Ratios and medians; the machine's noise is printed with them."""
