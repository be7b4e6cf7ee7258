"""Read and write the files of calibrations.  A new calibrated value goes here."""
