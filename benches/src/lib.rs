//! What the benches share: timing, in turns, so that a ratio holds on a machine whose speed wanders; and charts.

pub mod chart;

use std::borrow::Cow;
use std::error::Error;
use std::time::{Duration, Instant};

use half::f16;
use lunette_relight::asset::{Asset, Data};

/// The asset as it would be if this SH tensor, \[V, n²\] or \[V, n², 3\], had been baked with fewer bands: a frame reads
/// all that there are. Scales stay.
///
/// # Errors
/// When there is no such tensor.
pub fn fewer_bands(
    asset: &Asset<'static>,
    name: &str,
    order: usize,
) -> Result<Asset<'static>, Box<dyn Error>> {
    let (values, _) = asset.half(name).ok_or("no SH in the asset")?;
    let all = asset.order(name).unwrap_or(0).pow(2);
    let per_vertex = values.len() / asset.n_vertices();
    let colours = per_vertex / all;
    let rows = values.chunks_exact(per_vertex);
    let kept: Vec<f16> = rows.flat_map(|row| &row[..colours * order * order]).copied().collect();
    let shape = [asset.n_vertices(), order * order, 3];
    let mut asset = asset.clone();
    asset.insert(name, &shape[..if colours == 3 { 3 } else { 2 }], Data::F16(Cow::Owned(kept)));
    Ok(asset)
}

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
