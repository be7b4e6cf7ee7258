"""Compare variants side by side over captures: runs, tables, pictures, and a report."""
