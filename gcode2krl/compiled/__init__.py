"""What stages share that work on long columns: the compiled core, its inputs, chunks, threads."""
