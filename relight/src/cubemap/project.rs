//! Lights on a cubemap: the average radiance of each texel.
//!
//! | source | how |
//! |---|---|
//! | uniform | itself |
//! | CIE overcast, dome of a clear sky | Gauss points per texel, more near the sun and the horizon |
//! | cap, sun | the share of each texel that the disc covers, see [`disc`](super::disc) |
//! | equirect | its pixels summed texel by texel, see [`picture`](super::picture); kept with the picture |

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::{direction, disc, n_texels, picture, sample};
use crate::light::quadrature::gauss_legendre;
use crate::light::sky::compass_direction;
use crate::light::{Light, Source};

/// Writes the average radiance of `light` over each texel of an `n` x `n` x 6 cubemap to `out`. The energy
/// Σ out\[t\] Ω\[t\] is that of the light to 1e-3. Allocates only for a picture that was last asked for at another
/// resolution or turn.
///
/// # Panics
/// When `out` does not have 6 n² texels, or n is 0.
pub fn project_light(light: &Light, n: usize, out: &mut [[f32; 3]]) {
    project(light, n, out, |smooth, out| smooth(0, out));
}

/// As [`project_light`], over all threads of the current rayon pool.
///
/// # Panics
/// As [`project_light`].
#[cfg(feature = "rayon")]
pub fn project_light_parallel(light: &Light, n: usize, out: &mut [[f32; 3]]) {
    use rayon::prelude::*;
    // A few rows: texels below the horizon cost nothing, those about the sun much.
    let task = 4 * n;
    project(light, n, out, |smooth, out| {
        out.par_chunks_mut(task).enumerate().for_each(|(i, out)| smooth(i * task, out));
    });
}

/// Adds a smooth light to the texels from one on.
type AddSmooth<'a> = &'a (dyn Fn(usize, &mut [[f32; 3]]) + Sync);

/// Projects all sources; `spread` has smooth ones added to all texels.
fn project(light: &Light, n: usize, out: &mut [[f32; 3]], spread: impl Fn(AddSmooth, &mut [[f32; 3]])) {
    assert!(n > 0 && out.len() == n_texels(n), "a cubemap of side {n} has {} texels", n_texels(n));
    out.fill([0.0; 3]);
    for source in &light.sources {
        match source {
            Source::Uniform(radiance) => out.iter_mut().for_each(|texel| add(texel, *radiance)),
            Source::CieOvercast(sky) => {
                let view = Smooth { up: sky.up, focus: None };
                spread(&|first, out| add_smooth(n, &view, |d| sky.radiance(d), first, out), out);
            }
            Source::Cap(cap) => disc::add_disc(n, cap, None, out),
            Source::Sky(sky) => {
                // In twilight the glow stays at the horizon.
                let glow = sky.orientation() * compass_direction(sky.azimuth(), sky.elevation().max(0.0));
                let view = Smooth { up: sky.up(), focus: Some(glow) };
                spread(&|first, out| add_smooth(n, &view, |d| sky.dome_radiance(d), first, out), out);
                if let Some(sun) = sky.sun_above_horizon() {
                    disc::add_disc(n, &sun, Some(sky.up()), out);
                }
            }
            Source::Equirect(image) => picture::add_picture(n, image, out),
        }
    }
}

/// Radians about the sun in which the dome's glow is steep.
const NEAR_FOCUS: f32 = 0.35;

/// Height (a sine) under which the dome brightens towards the horizon.
const NEAR_HORIZON: f32 = 0.25;

/// A corner this near to the horizon lies on it: rounding.
const LEVEL: f32 = 1e-6;

/// Width of texels in which the dome is straight elsewhere, radians: its middle is then its mean to 1e-3.
const SMALL: f32 = 0.1;

/// Where a radiance that is smooth elsewhere is not.
struct Smooth {
    /// It ends at the horizon below this zenith.
    up: Vec3,
    /// It peaks here, and changes fast near the horizon, if this is given.
    focus: Option<Vec3>,
}

/// Positions and weights of a rule over 0..=1.
struct Rule(Vec<(f32, f32)>);

impl Rule {
    fn gauss<const N: usize>() -> Rule {
        Rule(gauss_legendre::<N>().iter().map(|&(x, w)| (0.5 * (x + 1.0) as f32, 0.5 * w as f32)).collect())
    }

    /// Equal steps: for what has an edge, where Gauss points gain nothing.
    fn midpoints(n: usize) -> Rule {
        Rule((0..n).map(|i| ((i as f32 + 0.5) / n as f32, 1.0 / n as f32)).collect())
    }
}

struct Rules {
    centre: Rule,
    plain: Rule,
    fine: Rule,
    finest: Rule,
    edge: Rule,
}

static RULES: LazyLock<Rules> = LazyLock::new(|| Rules {
    centre: Rule::midpoints(1),
    plain: Rule::gauss::<2>(),
    fine: Rule::gauss::<4>(),
    finest: Rule::gauss::<8>(),
    edge: Rule::midpoints(16),
});

impl Smooth {
    /// A rule good enough for a texel of about `size` radians; `None` where it lies below the horizon.
    fn rule(&self, n: usize, texel: usize, size: f32) -> Option<&'static Rule> {
        let centre = direction(n, texel, Vec2::splat(0.5));
        let height = centre.dot(self.up);
        let (low, high) = if height.abs() < size { self.heights(n, texel) } else { (height, height) };
        if high <= LEVEL {
            return None;
        }
        Some(self.rule_above(centre, size, low))
    }

    /// Heights of the lowest and highest corner: texels are cut by planes straight.
    fn heights(&self, n: usize, texel: usize) -> (f32, f32) {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE].map(|c| direction(n, texel, c).dot(self.up));
        corners.iter().fold((f32::MAX, f32::MIN), |(low, high), h| (low.min(*h), high.max(*h)))
    }

    fn rule_above(&self, centre: Vec3, size: f32, low: f32) -> &'static Rule {
        let is_cut = low < -LEVEL;
        let Some(focus) = self.focus else {
            return if is_cut { &RULES.edge } else { &RULES.plain };
        };
        let to_focus = focus.distance(centre);
        if is_cut {
            &RULES.edge
        } else if to_focus < 1.5 * size || (low < LEVEL && size > SMALL) {
            &RULES.finest
        } else if to_focus < NEAR_FOCUS || low < LEVEL {
            &RULES.fine
        } else if low < NEAR_HORIZON || size > SMALL {
            &RULES.plain
        } else {
            &RULES.centre
        }
    }
}

/// Adds the averages of a radiance that is 0 below the horizon to the texels from `first` on.
fn add_smooth(n: usize, view: &Smooth, radiance: impl Fn(Vec3) -> Vec3, first: usize, out: &mut [[f32; 3]]) {
    let size = 2.0 / n as f32;
    for (t, texel) in (first..).zip(out) {
        if let Some(rule) = view.rule(n, t, size) {
            add(texel, average(n, t, rule, &radiance));
        }
    }
}

fn average(n: usize, texel: usize, rule: &Rule, radiance: impl Fn(Vec3) -> Vec3) -> Vec3 {
    let (mut sum, mut total) = (Vec3::ZERO, 0.0);
    for &(y, weight_y) in &rule.0 {
        for &(x, weight_x) in &rule.0 {
            let (d, solid_angle) = sample(n, texel, Vec2::new(x, y));
            let weight = weight_x * weight_y * solid_angle;
            sum += weight * radiance(d);
            total += weight;
        }
    }
    sum / total
}

pub(super) fn add(texel: &mut [f32; 3], radiance: Vec3) {
    *texel = (Vec3::from(*texel) + radiance).to_array();
}
