"""Reference solutions, cases, fault rounds and strategies, for tests and benchmarks alike."""
