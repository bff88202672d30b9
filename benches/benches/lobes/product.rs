//! The integral of a product of two lobes: the fitted closed form against tables of it.
//!
//! A table holds ln(I (m + 1)), m the sum of the exponents, over ln(1 + e₁), ln(1 + e₂) and φ, with linear
//! interpolation along each. The truth is numeric quadrature.

use std::f64::consts::{FRAC_PI_2, PI};
use std::hint::black_box;

use lunette_benches::chart::{Chart, Page, Point, Series};
use lunette_benches::least;
use lunette_relight::lobe::product_integral;

const MAX_EXPONENT: f64 = 1e5;
/// Pairs of lobes that time is taken over.
const PAIRS: usize = 4096;

pub fn compare(page: &mut Page) -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "{:<22} {:>9} {:>9} {:>11} {:>10} {:>10}",
        "product", "kB", "build s", "mean abs", "worst rel", "ns"
    );
    let samples = samples();
    let mut table_points = Vec::new();
    for n in [12, 24, 48] {
        let started = std::time::Instant::now();
        let table = Table::new(n);
        let build = started.elapsed().as_secs_f64();
        let look_up = |a: f32, b: f32, versine: f32| table.integral(a, b, versine);
        let (mean, worst, ns) = judge(&samples, look_up);
        let size = table.values.len() as f64 * 4.0 / 1000.0;
        println!(
            "{:<22} {size:>9.0} {build:>9.2} {mean:>11.2e} {worst:>10.4} {ns:>10.1}",
            format!("table {n}³")
        );
        table_points.push(Point { x: ns, y: mean, label: format!("{n}³") });
    }
    let (mean, worst, ns) = judge(&samples, product_integral);
    println!("{:<22} {:>9} {:>9} {mean:>11.2e} {worst:>10.4} {ns:>10.1}", "closed form", 0, 0);
    worst_region();
    page.section(
        "Product of two lobes",
        "Mean absolute error of the integral over the paper's range of exponents.",
    );
    let form = vec![Point { x: ns, y: mean, label: "closed form".into() }];
    page.chart(&Chart {
        title: "Integral of a product: error against time".into(),
        x: "time of one, ns".into(),
        y: "mean absolute error, sr".into(),
        series: vec![
            Series { name: "table".into(), points: table_points },
            Series { name: "closed form".into(), points: form },
        ],
    })
}

/// Both exponents in 0..=1 and axes from 60° to 120° apart, where the paper's table is up to 50 % off.
fn worst_region() {
    let table = Table::new(48);
    let (mut form_off, mut table_off) = (0.0f64, 0.0f64);
    for k in 0..11 * 11 * 13 {
        let (a, b, phi) =
            (0.1 * f64::from(k % 11), 0.1 * f64::from(k / 11 % 11), f64::from(60 + 5 * (k / 121)));
        let phi = phi.to_radians();
        let truth = exact(a, b, phi);
        let off = |found: f32| (f64::from(found) / truth - 1.0).abs();
        let (a, b, versine) = (a as f32, b as f32, (1.0 - phi.cos()) as f32);
        form_off = form_off.max(off(product_integral(a, b, versine)));
        table_off = table_off.max(off(table.integral(a, b, versine)));
    }
    println!(
        "exponents 0 to 1, axes 60° to 120° apart: closed form at most {:.1} % off, table 48³ {:.1} %",
        100.0 * form_off,
        100.0 * table_off
    );
}

struct Sample {
    a: f32,
    b: f32,
    versine: f32,
    truth: f64,
}

/// The paper's exponents, 16 in each of [0, 1], [1, 10] … [10⁴, 10⁵], at angles evenly spread.
fn samples() -> Vec<Sample> {
    let exponent = |k: usize| {
        let (decade, step) = (k / 16, (k % 16) as f64 / 16.0);
        let low = if decade == 0 { 0.0 } else { 10f64.powi(decade as i32 - 1) };
        low + (10f64.powi(decade as i32) - low) * step
    };
    let mut samples = Vec::new();
    for k in 0..20_000usize {
        // A lattice of no common period.
        let (i, j) = (k * 37 % 96, k * 59 / 7 % 96);
        let phi = (k as f64 * 0.618_033_988_75).fract() * PI;
        let (a, b) = (exponent(i), exponent(j));
        let truth = exact(a, b, phi);
        samples.push(Sample { a: a as f32, b: b as f32, versine: (1.0 - phi.cos()) as f32, truth });
    }
    samples
}

/// Mean absolute error, worst relative error of integrals above 1e-6, and nanoseconds for one.
fn judge(samples: &[Sample], integral: impl Fn(f32, f32, f32) -> f32) -> (f64, f64, f64) {
    let (mut sum, mut worst) = (0.0, 0.0f64);
    for s in samples {
        let off = (f64::from(integral(s.a, s.b, s.versine)) - s.truth).abs();
        sum += off;
        if s.truth > 1e-6 {
            worst = worst.max(off / s.truth);
        }
    }
    let columns: [Vec<f32>; 3] = [
        samples[..PAIRS].iter().map(|s| s.a).collect(),
        samples[..PAIRS].iter().map(|s| s.b).collect(),
        samples[..PAIRS].iter().map(|s| s.versine).collect(),
    ];
    let mut out = vec![0.0; PAIRS];
    let seconds = least(50, || {
        let [a, b, versine] = black_box(&columns);
        for (((out, a), b), v) in out.iter_mut().zip(a).zip(b).zip(versine) {
            *out = integral(*a, *b, *v);
        }
        black_box(&mut out);
    });
    (sum / samples.len() as f64, worst, seconds / PAIRS as f64 * 1e9)
}

/// ln(I (m + 1)) on n × n × n places.
struct Table {
    n: usize,
    values: Vec<f32>,
}

impl Table {
    fn new(n: usize) -> Table {
        let place = |i: usize| i as f64 / (n - 1) as f64;
        let exponent = |i: usize| (place(i) * MAX_EXPONENT.ln_1p()).exp_m1();
        let mut values = vec![0.0; n * n * n];
        for (i, j) in (0..n * n).map(|k| (k / n, k % n)).filter(|(i, j)| i >= j) {
            for k in 0..n {
                let (a, b, phi) = (exponent(i), exponent(j), place(k) * PI * 0.999);
                let value = (exact(a, b, phi) * (a + b + 1.0)).max(1e-38).ln() as f32;
                values[(i * n + j) * n + k] = value;
                values[(j * n + i) * n + k] = value;
            }
        }
        Table { n, values }
    }

    fn integral(&self, a: f32, b: f32, versine: f32) -> f32 {
        let last = (self.n - 1) as f32;
        let scale = last / (MAX_EXPONENT as f32).ln_1p();
        let angle = (1.0 - versine).clamp(-1.0, 1.0).acos();
        let places = [a.ln_1p() * scale, b.ln_1p() * scale, angle * last / (PI as f32 * 0.999)];
        let low = places.map(|p| (p as usize).min(self.n - 2));
        let t: [f32; 3] = std::array::from_fn(|k| places[k] - low[k] as f32);
        let at = |i: usize, j: usize, k: usize| {
            self.values[((low[0] + i) * self.n + low[1] + j) * self.n + low[2] + k]
        };
        let mix = |x: f32, y: f32, t: f32| x + t * (y - x);
        let line = |i: usize, j: usize| mix(at(i, j, 0), at(i, j, 1), t[2]);
        let side = |i: usize| mix(line(i, 0), line(i, 1), t[1]);
        mix(side(0), side(1), t[0]).exp() / (a + b + 1.0)
    }
}

/// The exact integral: see [`product_integral`]'s module for the split into two.
fn exact(e1: f64, e2: f64, phi: f64) -> f64 {
    let (a, b) = (e1.max(e2), e1.min(e2));
    let peak = if a + b > 0.0 { 0.5 * (phi + ((b - a) / (a + b) * phi.sin()).asin()) } else { 0.5 * phi };
    let reach = 12.0 / (a + b + 1.0).sqrt();
    let (low, high) = ((phi - FRAC_PI_2).max(peak - reach), FRAC_PI_2.min(peak + reach));
    let in_plane = |psi: f64| psi.cos().max(0.0).powf(a) * (phi - psi).cos().max(0.0).powf(b);
    let across = |beta: f64| beta.cos().powf(a + b + 1.0);
    let wide = FRAC_PI_2.min(reach);
    integrate(in_plane, low, high) * integrate(across, -wide, wide)
}

/// The trapezoid rule after x = tanh(π/2 sinh s).
fn integrate(f: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let n = 120;
    let h = 8.0 / f64::from(n);
    let term = |i: i32| {
        let s = -4.0 + (f64::from(i) + 0.5) * h;
        let t = FRAC_PI_2 * s.sinh();
        f(0.5 * (high + low) + 0.5 * (high - low) * t.tanh()) * FRAC_PI_2 * s.cosh() / t.cosh().powi(2)
    };
    0.5 * (high - low) * h * (0..n).map(term).sum::<f64>()
}
