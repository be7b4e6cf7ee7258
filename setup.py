"""Maps the folders of the top level to one import package; all else is in pyproject.toml."""

from setuptools import find_namespace_packages, find_packages, setup

FOLDERS = ("graph", "nodes", "kernels", "pipelines", "rings")
NO_PACKAGES = ("*.tests*", "*.docs*", "*__pycache__*")

setup(
    packages=[
        *find_packages(include=["tactograph", "tactograph.*"]),
        *(
            f"tactograph.{package}"
            for folder in FOLDERS
            # Folders of data, too, or setuptools warns of each.
            for package in find_namespace_packages(
                include=[folder, f"{folder}.*"], exclude=NO_PACKAGES
            )
        ),
    ],
    package_dir={f"tactograph.{folder}": folder for folder in FOLDERS},
)
