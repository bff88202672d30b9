//! A naive oracle: single rays, a stratified hemisphere, double precision, textbook spherical harmonics.
//!
//! Slow and plain on purpose. It shares with the baker only Embree's queries, which have tests of their own.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use lunette_ffi as ffi;
use lunette_scenes::Mesh;

/// What an oriented point sees of the sky.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Share of the hemisphere.
    pub open: f64,
    /// Cosine-weighted share of the hemisphere.
    pub ao: f64,
    /// Mean visible direction, not normalised.
    pub bent: DVec3,
    /// Transfer ∫ V yᵢ max(n·ω, 0) dω, \[n²\].
    pub sh: Vec<f64>,
}

impl Seen {
    /// Radius of the cap of the visible solid angle, radians.
    pub fn aperture(&self) -> f64 {
        (1.0 - self.open).acos()
    }
}

/// A mesh ready for the oracle's rays.
pub struct Oracle {
    tree: ffi::Scene,
    /// Height of a ray's origin over the surface, metres.
    lift: f32,
}

impl Oracle {
    /// # Panics
    /// When Embree is missing or refuses the mesh.
    pub fn new(mesh: &Mesh) -> Oracle {
        let device = ffi::Device::new().expect("Embree");
        let mut builder = ffi::SceneBuilder::new(&device).expect("a scene");
        let positions: Vec<[f32; 3]> = mesh.position.iter().map(|p| p.to_array()).collect();
        builder.add_triangles(&positions, &mesh.index).expect("a mesh");
        let (low, high) = mesh.bounds();
        Oracle { tree: builder.commit().expect("a tree"), lift: 1e-5 * (high - low).length() }
    }

    /// What the point `p` with the unit normal `n` sees by `side`² rays, with SH of `order` bands.
    pub fn look(&self, p: Vec3, n: Vec3, side: usize, order: usize) -> Seen {
        let origin = (p + self.lift * n).to_array();
        let mut seen = Seen { open: 0.0, ao: 0.0, bent: DVec3::ZERO, sh: vec![0.0; order * order] };
        for (d, z) in directions(p, n, side) {
            if self.tree.occluded(&ffi::Ray::new(origin, d.as_vec3().to_array())) {
                continue;
            }
            let weight = 1.0 / (side * side) as f64;
            seen.open += weight;
            seen.ao += 2.0 * z * weight;
            seen.bent += d * weight;
            for (sum, y) in seen.sh.iter_mut().zip(spherical_harmonics(order, d)) {
                *sum += 2.0 * PI * z * weight * y;
            }
        }
        seen
    }

    /// Calls `met` with direction and end of each of the same `side`² rays.
    pub fn for_each_ray(&self, p: Vec3, n: Vec3, side: usize, mut met: impl FnMut(Vec3, End)) {
        let origin = (p + self.lift * n).to_array();
        for (d, _) in directions(p, n, side) {
            let d = d.as_vec3();
            let end = match self.tree.intersect(&ffi::Ray::new(origin, d.to_array())) {
                None => End::Sky,
                Some(h) if d.dot(Vec3::from(h.normal)) > 0.0 => End::Back,
                Some(h) => End::Front(h.primitive as usize, [1.0 - h.u - h.v, h.u, h.v]),
            };
            met(d, end);
        }
    }
}

/// What a ray meets.
#[derive(Clone, Copy, Debug)]
pub enum End {
    /// Nothing.
    Sky,
    /// The back of a triangle.
    Back,
    /// The front of the triangle of this number, at these weights of its corners.
    Front(usize, [f32; 3]),
}

/// `side`² stratified directions, uniform over the hemisphere of `n`, and their cosines.
fn directions(p: Vec3, n: Vec3, side: usize) -> impl Iterator<Item = (DVec3, f64)> {
    let mut random = Random(u64::from(p.x.to_bits()) << 32 | u64::from(p.z.to_bits()) | 1);
    let (s, t) = n.as_dvec3().any_orthonormal_pair();
    (0..side * side).map(move |cell| {
        let z = ((cell % side) as f64 + random.next()) / side as f64;
        let phi = 2.0 * PI * ((cell / side) as f64 + random.next()) / side as f64;
        let r = (1.0 - z * z).sqrt();
        (s * (r * phi.cos()) + t * (r * phi.sin()) + n.as_dvec3() * z, z)
    })
}

/// A mean and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Its standard error.
    pub error: f64,
}

impl Estimate {
    /// Of independent values.
    ///
    /// # Panics
    /// When there are fewer than two.
    pub fn of(values: impl Iterator<Item = f64>) -> Estimate {
        let values: Vec<f64> = values.collect();
        let n = values.len() as f64;
        assert!(n >= 2.0, "one value does not know its error");
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
        Estimate { mean, error: (squares / (n * (n - 1.0))).sqrt() }
    }
}

/// Independent sets of rays from which a standard error is computed: uncertain by a sixth.
const N_SETS: usize = 16;

impl Oracle {
    /// Irradiance of the point `p` with the unit normal `n` through panes, under each of some lights given as radiance
    /// of a direction, by 16 sets of `side`² rays.
    pub fn through<const N: usize>(
        &self,
        (p, n): (Vec3, Vec3),
        panes: &[[Vec3; 3]],
        side: usize,
        radiance: impl Fn(Vec3) -> [f64; N],
    ) -> [Estimate; N] {
        let mut random = Random(u64::from(p.y.to_bits()) << 32 | u64::from(p.z.to_bits()) | 1);
        let (s, t) = n.as_dvec3().any_orthonormal_pair();
        let origin = p + self.lift * n;
        let mut sets = [[0.0; N]; N_SETS];
        for set in &mut sets {
            for cell in 0..side * side {
                let z = ((cell % side) as f64 + random.next()) / side as f64;
                let phi = 2.0 * PI * ((cell / side) as f64 + random.next()) / side as f64;
                let r = (1.0 - z * z).sqrt();
                let d = (s * (r * phi.cos()) + t * (r * phi.sin()) + n.as_dvec3() * z).as_vec3();
                let passes = panes.iter().any(|pane| meets(origin, d, pane));
                if passes && !self.tree.occluded(&ffi::Ray::new(origin.to_array(), d.to_array())) {
                    let weight = 2.0 * PI * z / (side * side) as f64;
                    set.iter_mut().zip(radiance(d)).for_each(|(sum, l)| *sum += weight * l);
                }
            }
        }
        std::array::from_fn(|i| Estimate::of(sets.iter().map(|set| set[i])))
    }
}

/// Whether a ray meets a triangle, from either side.
///
/// Based on: Möller and Trumbore, Fast, Minimum Storage Ray-Triangle Intersection, 1997.
fn meets(origin: Vec3, d: Vec3, triangle: &[Vec3; 3]) -> bool {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    let (o, d) = (origin.as_dvec3(), d.as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let p = d.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return false;
    }
    let q = (o - a).cross(e1);
    let (u, v, t) = ((o - a).dot(p) / det, d.dot(q) / det, e2.dot(q) / det);
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0
}

/// Knuth's linear congruential generator: nothing that the baker uses.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Real orthonormal spherical harmonics with the Condon-Shortley sign, index l(l+1)+m, by the recurrences of the
/// associated Legendre functions.
pub fn spherical_harmonics(order: usize, d: DVec3) -> Vec<f64> {
    let phi = d.y.atan2(d.x);
    let mut y = vec![0.0; order * order];
    for l in 0..order as i32 {
        for m in 0..=l {
            let k = ((2 * l + 1) as f64 / (4.0 * PI) * factorial(l - m) / factorial(l + m)).sqrt();
            let p = k * legendre(l, m, d.z);
            let at = |m: i32| (l * (l + 1) + m) as usize;
            if m == 0 {
                y[at(0)] = p;
            } else {
                let angle = f64::from(m) * phi;
                y[at(m)] = 2f64.sqrt() * p * angle.cos();
                y[at(-m)] = 2f64.sqrt() * p * angle.sin();
            }
        }
    }
    y
}

fn factorial(n: i32) -> f64 {
    (1..=n).map(f64::from).product()
}

/// P_l^m(x) with (-1)^m.
fn legendre(l: i32, m: i32, x: f64) -> f64 {
    let sin = (1.0 - x * x).max(0.0).sqrt();
    let mut last = (1..=m).map(|i| -f64::from(2 * i - 1) * sin).product();
    let mut before = 0.0;
    for i in m + 1..=l {
        let next = (f64::from(2 * i - 1) * x * last - f64::from(i + m - 1) * before) / f64::from(i - m);
        (before, last) = (last, next);
    }
    last
}
