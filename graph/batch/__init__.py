"""Many captures through one graph: chunk by chunk, by workers, into one store.

`captures` finds them, `store` holds what came of each, `work` is what a worker does with a
chunk, `serial`, `processes` and `cluster` are the three kinds of workers, and `batch` puts
them together.  A chunk is written by one worker; its captures count as done only when all
else is written, so a batch that was stopped anywhere can go on.
"""
