"""What can be done with a calibration of any kind: a module for each, by its name.

``KIND`` declares its file, ``draw(arrays, title, target)`` draws it, and ``read(file)`` returns
its record, if it holds a film at rest.  A kind that a ring brings names the ``GRAPH`` that checks
its touches, and the ``OVERLAY`` that draws some (`rank_checks`).
"""
