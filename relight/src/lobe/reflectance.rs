//! Reflectance as cosine lobes in the direction of the incoming light.
//!
//! f̃(v) = f_r(v, v₀) max(n·v, 0) for a fixed view direction v₀ is a diffuse lobe about the normal and up to
//! [`MAX_SHAPED`] lobes of Lafortune's form, of which Phong's are a case:
//!
//! ```text
//! (C_t t·v₀ t·v + C_b b·v₀ b·v + C_n n·v₀ n·v)ᵉ = |C v₀|ᵉ max(a·v, 0)ᵉ,     a = C v₀ / |C v₀|
//! ```
//!
//! The cosine that multiplies them (all but the original Phong's) makes a product of two lobes, taken as one.
//!
//! Units: sr⁻¹. Values vary over the surface by giving each point its own material.
//!
//! Based on: Phong, Illumination for computer generated pictures, 1975; Lewis, Making shaders more physically
//! plausible, 1994; Lafortune, Foo, Torrance and Greenberg, Non-linear approximation of reflectance functions,
//! 1997.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

use super::blockers::LANES;
use super::fast::{exp2, log2};
use super::product::product_shape;
use super::product_integral;

/// Most lobes of one material besides the diffuse one.
pub const MAX_SHAPED: usize = 3;
/// Most lobes of one material.
pub const MAX_LOBES: usize = MAX_SHAPED + 1;

/// A lobe whose scale has colour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ColouredLobe {
    /// Of unit length.
    pub axis: Vec3,
    /// From 0 up.
    pub exponent: f32,
    /// Per linear Rec.709 channel \[1/sr\].
    pub scale: Vec3,
}

/// Whether a lobe is part of f_r, which the cosine of the incoming light multiplies, or of f̃.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cosine {
    /// Of f_r.
    #[default]
    Times,
    /// Of f̃ itself, as in the original Phong model.
    Without,
}

/// A lobe of Lafortune's form.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapedLobe {
    /// C_t, C_b, C_n along tangent, bitangent and normal. (-1, -1, 1) mirrors, (1, 1, 1) reflects back, |C_t|
    /// other than |C_b| is anisotropic, |C_t| above |C_n| is off-specular.
    pub direction: Vec3,
    /// e, from 0 up.
    pub exponent: f32,
    /// Colour of the lobe \[1/sr\].
    pub scale: Vec3,
    /// Whether the cosine multiplies it.
    pub cosine: Cosine,
}

/// How a surface answers to light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reflectance {
    /// f_r of the diffuse part, albedo / π \[1/sr\].
    pub diffuse: Vec3,
    /// Those in use come first; the others have scale 0.
    pub shaped: [ShapedLobe; MAX_SHAPED],
}

/// C of a mirror.
const MIRROR: Vec3 = Vec3::new(-1.0, -1.0, 1.0);

impl Reflectance {
    /// f_r = ρ / π.
    pub fn lambert(albedo: Vec3) -> Reflectance {
        Reflectance { diffuse: albedo * FRAC_1_PI, ..Reflectance::default() }
    }

    /// f̃ = k_d (n·v) + k_s max(r·v, 0)ᵉ, k_d and k_s in 1/sr: the original form, which does not conserve energy.
    pub fn phong(diffuse: Vec3, specular: Vec3, exponent: f32) -> Reflectance {
        let lobe = ShapedLobe { direction: MIRROR, exponent, scale: specular, cosine: Cosine::Without };
        Reflectance { diffuse, shaped: [lobe, ShapedLobe::default(), ShapedLobe::default()] }
    }

    /// f_r = ρ_d / π + ρ_s (e + 2) / 2π max(r·v, 0)ᵉ: reflects at most ρ_d + ρ_s.
    pub fn modified_phong(albedo: Vec3, specular: Vec3, exponent: f32) -> Reflectance {
        let scale = specular * ((exponent + 2.0) / TAU);
        let lobe = ShapedLobe { direction: MIRROR, exponent, scale, cosine: Cosine::Times };
        Reflectance {
            diffuse: albedo * FRAC_1_PI,
            shaped: [lobe, ShapedLobe::default(), ShapedLobe::default()],
        }
    }

    /// f_r = ρ / π + the first [`MAX_SHAPED`] of these lobes.
    pub fn lafortune(albedo: Vec3, lobes: &[ShapedLobe]) -> Reflectance {
        let mut shaped = [ShapedLobe::default(); MAX_SHAPED];
        shaped.iter_mut().zip(lobes).for_each(|(to, from)| *to = *from);
        Reflectance { diffuse: albedo * FRAC_1_PI, shaped }
    }
}

/// The lobes of f̃ for light leaving towards `view` (unit length, away from the surface); unused ones have scale
/// 0, as have all for a view from below. `tangent` need not be perpendicular to the normal; any serves where it
/// has no direction.
pub fn reflectance_lobes(
    material: &Reflectance,
    normal: Vec3,
    tangent: Vec3,
    view: Vec3,
) -> [ColouredLobe; MAX_LOBES] {
    let lanes = |v: Vec3| [[v.x; LANES], [v.y; LANES], [v.z; LANES]];
    let frames = Frames::new(&lanes(normal), &lanes(tangent), &lanes(view));
    let mut columns = [Column::default(); MAX_LOBES];
    columns[0] = frames.diffuse(&[material; LANES]);
    for k in 0..MAX_SHAPED {
        columns[k + 1] = frames.shaped(&[material; LANES], k);
    }
    columns.map(|column| ColouredLobe {
        axis: lane_of(&column.axis, 0),
        exponent: column.exponent[0],
        scale: lane_of(&column.scale, 0),
    })
}

/// Vectors of eight points, as columns.
pub(super) type Columns = [[f32; LANES]; 3];

#[inline(always)]
pub(super) fn lane_of(columns: &Columns, lane: usize) -> Vec3 {
    Vec3::new(columns[0][lane], columns[1][lane], columns[2][lane])
}

/// One lobe of eight points, as columns.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Column {
    pub axis: Columns,
    pub exponent: [f32; LANES],
    pub scale: Columns,
}

/// Local frames of eight points, and their view directions in them.
pub(super) struct Frames {
    tangent: Columns,
    bitangent: Columns,
    normal: Columns,
    view: Columns,
    /// 1, or 0 for a view from below.
    seen: [f32; LANES],
}

impl Frames {
    #[inline(always)]
    pub fn new(normal: &Columns, tangent: &Columns, view: &Columns) -> Frames {
        let mut out = Frames {
            tangent: *tangent,
            bitangent: *tangent,
            normal: *normal,
            view: *view,
            seen: [0.0; LANES],
        };
        for lane in 0..LANES {
            let (n, v) = (lane_of(normal, lane), lane_of(view, lane));
            let given = lane_of(tangent, lane);
            let across = given - n * n.dot(given);
            let length = across.length_squared();
            let (other, _) = n.any_orthonormal_pair();
            let usable = length > 1e-10;
            let t = if usable { across * (1.0 / length.max(1e-10).sqrt()) } else { other };
            let b = n.cross(t);
            for (c, (t, b)) in t.to_array().into_iter().zip(b.to_array()).enumerate() {
                out.tangent[c][lane] = t;
                out.bitangent[c][lane] = b;
            }
            out.view[0][lane] = t.dot(v);
            out.view[1][lane] = b.dot(v);
            out.view[2][lane] = n.dot(v);
            out.seen[lane] = if n.dot(v) > 0.0 { 1.0 } else { 0.0 };
        }
        out
    }

    #[inline(always)]
    pub fn diffuse(&self, materials: &[&Reflectance; LANES]) -> Column {
        let mut out = Column { axis: self.normal, exponent: [1.0; LANES], scale: [[0.0; LANES]; 3] };
        for lane in 0..LANES {
            (0..3).for_each(|c| out.scale[c][lane] = materials[lane].diffuse[c] * self.seen[lane]);
        }
        out
    }

    #[inline(always)]
    pub fn shaped(&self, materials: &[&Reflectance; LANES], k: usize) -> Column {
        let mut direction = [[0.0; LANES]; 3];
        let mut cosine = [0.0; LANES];
        let mut out = Column::default();
        for lane in 0..LANES {
            let lobe = &materials[lane].shaped[k];
            for c in 0..3 {
                direction[c][lane] = lobe.direction[c];
                out.scale[c][lane] = lobe.scale[c];
            }
            out.exponent[lane] = lobe.exponent;
            cosine[lane] = if lobe.cosine == Cosine::Times { 1.0 } else { 0.0 };
        }
        for lane in 0..LANES {
            self.shape(&direction, &cosine, lane, &mut out);
        }
        out
    }

    /// Turns one lane's lobe into the world and multiplies it by the cosine.
    #[inline(always)]
    fn shape(&self, direction: &Columns, cosine: &[f32; LANES], lane: usize, out: &mut Column) {
        let local = lane_of(direction, lane) * lane_of(&self.view, lane);
        let squared = local.length_squared().max(1e-30);
        let local = local * (1.0 / squared.sqrt());
        let normal = lane_of(&self.normal, lane);
        let axis = lane_of(&self.tangent, lane) * local.x
            + lane_of(&self.bitangent, lane) * local.y
            + normal * local.z;
        let e = out.exponent[lane].max(0.0);
        let power = exp2(0.5 * e * log2(squared));
        // The product with the cosine, as in `super::product`.
        let versine = 0.5 * (axis - normal).length_squared();
        let shape = product_shape(e, 1.0, versine);
        let both = axis * shape.weight_1 + normal * shape.weight_2;
        let both = both * (1.0 / both.length_squared().max(1e-30).sqrt());
        let ratio = product_integral(e, 1.0, versine.min(2.0)) * (shape.exponent + 1.0) / TAU;
        let times = cosine[lane] > 0.0;
        let axis = Vec3::select(glam::BVec3::splat(times), both, axis);
        (0..3).for_each(|c| out.axis[c][lane] = axis[c]);
        out.exponent[lane] = if times { shape.exponent } else { e };
        let factor = power * self.seen[lane] * if times { ratio } else { 1.0 };
        (0..3).for_each(|c| out.scale[c][lane] *= factor);
    }
}
