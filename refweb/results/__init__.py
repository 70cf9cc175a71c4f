"""One instant, its observables, the solution and the result folder; it does not know how they were computed."""
