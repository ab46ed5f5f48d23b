"""Running many simulations: on local processes or any executor of concurrent.futures, into one store."""
