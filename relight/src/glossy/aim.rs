//! Where in a texel its light comes from.
//!
//! A row knows light by texels, and a lobe sees that of a texel come from its middle. The sun is twenty times smaller
//! than a texel, and its highlight would be off by as much as its place in it: 0.03 radians, where a lobe of exponent 10
//! falls by a tenth. So the direction of a texel that holds discs smaller than itself becomes the mean of its middle
//! and the discs', weighted by their light.
//!
//! Where it breaks: behind frosted glass, which spreads the disc, the middle stays; where something outside stands before
//! the sun, the texel keeps less light than the disc has, and counts as if it held the disc alone.

use glam::{Vec2, Vec3};

use super::Direct;
use crate::cubemap::{self, add_disc};
use crate::light::{Cap, Light, split};
use crate::portal_frame::PortalFrame;

/// Discs in a light without an allocation: a sun, some lamps, the spots of a picture or two.
const CAPS: usize = 16;

/// Room to work in, kept from frame to frame.
pub struct Aims {
    caps: Vec<Cap>,
    disc: Vec<[f32; 3]>,
}

impl Aims {
    pub fn new() -> Aims {
        Aims { caps: Vec::with_capacity(CAPS), disc: Vec::new() }
    }

    /// Makes room for cubemaps of `n` x `n` x 6.
    pub fn reserve(&mut self, n: usize) {
        let texels = cubemap::n_texels(n);
        if self.disc.len() < texels {
            self.disc.resize(texels, [0.0; 3]);
        }
    }

    /// Takes on the discs of a light.
    pub fn split(&mut self, light: &Light) {
        split(light, &mut self.caps);
    }

    /// Moves the directions of portal `k`.
    pub fn apply(&mut self, frame: &PortalFrame, k: usize, direct: &mut Direct) {
        let n = frame.resolution(k);
        direct.restore();
        if frame.material(k).frost > 0.0 {
            return;
        }
        let disc = &mut self.disc[..cubemap::n_texels(n)];
        for cap in self.caps.iter().filter(|cap| cap.radius * (n as f32) < 1.0) {
            disc.fill([0.0; 3]);
            add_disc(n, cap, None, disc);
            for (t, l) in disc.iter().enumerate().filter(|(_, l)| **l != [0.0; 3]) {
                let all = Vec3::from(frame.captured(k)[t]).element_sum();
                let share = (Vec3::from(*l).element_sum() / all.max(f32::MIN_POSITIVE)).min(1.0);
                let towards = cap.axis - cubemap::direction(n, t, Vec2::splat(0.5));
                direct.directions[t] += (share * towards).extend(0.0);
                direct.moved.push(t as u16);
            }
        }
        for &t in &direct.moved {
            let d = &mut direct.directions[usize::from(t)];
            *d = d.normalize_or_zero();
        }
    }
}

impl Direct {
    /// Texels shine from their middles again.
    fn restore(&mut self) {
        for t in self.moved.drain(..) {
            let t = usize::from(t);
            self.directions[t] = cubemap::direction(self.n, t, Vec2::splat(0.5)).extend(0.0);
        }
    }
}
