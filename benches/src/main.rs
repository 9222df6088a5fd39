//! Benchmarks: ours and the rivals, in one run.

fn main() {}
