"""Documentation: the commands and statements on its pages are tested."""
