//! What the benches share: timing, in turns, so that a ratio holds on a machine whose speed wanders; and charts.

pub mod chart;

use std::time::{Duration, Instant};

/// Runs two things in turn, `rounds` times, and gives the least time of each, seconds.
pub fn duel(rounds: usize, mut a: impl FnMut(), mut b: impl FnMut()) -> (f64, f64) {
    let mut least = (Duration::MAX, Duration::MAX);
    for _ in 0..rounds {
        least.0 = least.0.min(time(&mut a));
        least.1 = least.1.min(time(&mut b));
    }
    (least.0.as_secs_f64(), least.1.as_secs_f64())
}

/// Runs something `rounds` times and gives the least time, seconds.
pub fn least(rounds: usize, mut work: impl FnMut()) -> f64 {
    (0..rounds).map(|_| time(&mut work)).min().unwrap_or(Duration::MAX).as_secs_f64()
}

fn time(work: &mut impl FnMut()) -> Duration {
    let started = Instant::now();
    work();
    started.elapsed()
}
