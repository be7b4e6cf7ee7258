"""Maps the folders of the top level to one import package; all else is in pyproject.toml."""

from setuptools import find_packages, setup

FOLDERS = ("graph", "nodes", "kernels", "pipelines", "rings")

setup(
    packages=[
        *find_packages(include=["tactograph", "tactograph.*"]),
        *(
            f"tactograph.{package}"
            for folder in FOLDERS
            for package in find_packages(include=[folder, f"{folder}.*"])
            if ".tests" not in package
        ),
    ],
    package_dir={f"tactograph.{folder}": folder for folder in FOLDERS},
)
