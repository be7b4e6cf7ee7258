"""Runs of many captures through one graph: chunk by chunk, by workers, into one store.

`captures` finds them, `job` says what to do with each, `store` holds the results (`entry`).
A `worker` does chunks with a pipeline of its own, in this process or in those of `processes`, which
`fork_server` starts with the modules that are `imported_ahead`.  `batch` opens the store and cuts
the rest into chunks, `run_batch` does and prints all that.  One worker writes a chunk.  Its
captures count as done only when all else is written, so a batch can be stopped anywhere and
continued.  `batch_maps` reads what it has done.
"""
