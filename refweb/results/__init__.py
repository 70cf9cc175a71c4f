"""Results: an instant, its observables, the solution and the folder; they do not know how they were computed."""
