"""Runs of many captures through one graph: chunk by chunk, by workers, into one store.

`captures` finds them, `job` says what to do with each, `store` holds the results (`entry`).
`worker` does a chunk with the pipeline that `open_job` opens.  Its `Serial` and `processes` are the
two kinds of workers (`worker_count` says how many processes, `fork_server` starts them with the
modules that are `imported_ahead`), and `batch` puts them together.  One worker writes a chunk.  Its
captures count as done only when all else is written, so a batch can be stopped anywhere and
continued.
"""

from tactograph.graph.extras import need

need("batch", "a batch", "zarr", "numcodecs")
