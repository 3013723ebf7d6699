"""Evolution of controllers: batches of arenas in one compiled kernel, and CMA-ES over a controller's parameters.

`reactive_kernel` moves many arenas of reactive robots, `batch` gives it a scenario, `evolution` searches, and `journal`
keeps its generations on disk. Results of a batch are statistics: a run of the emulator has other noise.
"""
