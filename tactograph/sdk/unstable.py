"""What the shipped rings use beyond the sdk; it may change with any version.

The names and their modules are in ``unstable.pyi``.
"""

from tactograph.sdk._late_names import late_names

__getattr__, sources = late_names(__name__, __file__)
