"""What accuracy costs in time: measured into CSV files, from which page and figures are made."""
