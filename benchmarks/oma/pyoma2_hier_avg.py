"""pyOMA2's `hier_avg`, the best of its automatic selections, on stored windows; runs in the peers' environment."""

from collections.abc import Callable
from typing import Any

import numpy as np

Found = list[tuple[list[float], list[list[float]]]]  # a window: frequencies [Hz] and shapes, real parts


def hier_avg(files: list[str], rate: float) -> tuple[Callable[[], list[Any]], Callable[[list[Any]], Found]]:
    """Return a function that identifies windows with pyOMA2's default settings, and one that reads its result."""
    from pyoma2.algorithms import SSI
    from pyoma2.algorithms.data.run_params import Clustering
    from pyoma2.setup import SingleSetup

    windows = [np.load(file) for file in files]

    def all_windows() -> list[Any]:
        results = []
        for data in windows:
            setup, ssi = SingleSetup(data, fs=rate), SSI(name="ssi", method="cov", br=20, ordmax=50)
            setup.add_algorithms(ssi)
            setup.run_by_name("ssi")
            ssi.add_clustering(Clustering(name="clusters", quick="hier_avg"))
            ssi.run_clustering("clusters")
            results.append(ssi.result.clustering_results["clusters"])
        return results

    def read(results: list[Any]) -> Found:
        return [(np.asarray(r.Fn).tolist(), np.real(np.asarray(r.Phi)).T.tolist()) for r in results]

    return all_windows, read
