"""What accuracy costs in time: measured into CSV files, then drawn and told from them."""
