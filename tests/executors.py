"""Executors for the tests of long computations."""

from concurrent.futures import Executor, Future

from distributed import LocalCluster


def local_cluster(processes):
    """One worker of dask on this machine; a scheduler without a dashboard still takes a port, here any that is free."""
    return LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=processes,
        scheduler_kwargs={"dashboard": False, "dashboard_address": ":0"},
    )


class Failing(Executor):
    """Fails with given exceptions first, then works."""

    def __init__(self, *errors):
        self.errors, self.sent = list(errors), 0

    def submit(self, function, /, *arguments):
        self.sent += 1
        future = Future()
        if self.errors:
            future.set_exception(self.errors.pop(0))
        else:
            future.set_result(function(*arguments))
        return future
