"""Columns of tables: headings with units, times, dates, temperatures, sampling grids."""
