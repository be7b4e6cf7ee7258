"""Fixtures and options of all tests, those of rings too."""

pytest_plugins = ("tests.fixtures",)
