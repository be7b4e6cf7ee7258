"""Many captures through one graph: chunk by chunk, by workers, into one store.

`captures` finds them, `job` says what to do with each, `store` holds what came of it (`entry`),
`worker` is what does a chunk, with the pipeline that `open_job` opens; `serial`, `processes` and
`cluster` are the three kinds of workers (`worker_count` says how many processes, `fork_server`
starts them with what is `imported_ahead`), and `batch` puts them together.  A chunk is written by
one worker; its captures count as done only when all else is written, so a batch that was stopped
anywhere can go on.
"""

from tactograph.graph.extras import need

need("batch", "a batch", "zarr", "numcodecs", "fsspec")
