"""Where nodes run.  NumPy needs nothing; `opencl` drives one device through pyopencl."""
