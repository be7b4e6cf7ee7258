"""The kinds of calibrations, a module for each, named after the kind.

``KIND`` declares the file, ``draw(part, arrays)`` draws it into a part of a figure, and
``read(file)`` returns its record if it has a film at rest.  A ring's kind also names the ``GRAPH``
that checks its touches, and the ``OVERLAY`` that draws some (`rank_checks`).
"""
