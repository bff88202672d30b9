//! A rabbit from soft balls: a smooth closed object that is nobody's.
//!
//! The surface f(p) = 0, with f = sum of (1 - d²)² - 0.3 over the balls whose ellipsoidal distance d is below 1, is
//! netted (one vertex for each cell of a grid that the surface crosses, at the mean of its crossings, one quadrilateral for each crossed
//! grid edge) and the vertices then evened out on the surface. Closed by its make.
//!
//! Based on: Wyvill, McPheeters & Wyvill, Data structure for soft objects, 1986; Gibson, Constrained elastic
//! surface nets, 1998. Details below two cells are lost.

use std::collections::HashMap;

use glam::{IVec3, Vec3, ivec3, vec3};

use super::draft::{Draft, Paint, has_area, mean_normals, split};

/// An ellipsoid of influence: centre and half axes, in units of the rabbit's height.
const BALLS: [(Vec3, Vec3); 10] = [
    (vec3(0.00, 0.14, 0.14), vec3(0.34, 0.24, 0.42)),
    (vec3(0.00, 0.30, -0.05), vec3(0.38, 0.40, 0.48)),
    (vec3(0.00, 0.42, 0.22), vec3(0.28, 0.34, 0.30)),
    (vec3(0.00, 0.62, 0.34), vec3(0.27, 0.26, 0.30)),
    (vec3(-0.10, 0.86, 0.26), vec3(0.095, 0.27, 0.12)),
    (vec3(0.10, 0.86, 0.26), vec3(0.095, 0.27, 0.12)),
    (vec3(-0.22, 0.12, -0.10), vec3(0.19, 0.20, 0.34)),
    (vec3(0.22, 0.12, -0.10), vec3(0.19, 0.20, 0.34)),
    (vec3(0.00, 0.10, 0.36), vec3(0.24, 0.17, 0.20)),
    (vec3(0.00, 0.28, -0.46), vec3(0.16, 0.16, 0.16)),
];

/// The level of the sum at which the surface lies.
const LEVEL: f32 = 0.3;

/// Largest cell, of the rabbit's height: the ears have a little more than two.
const COARSEST: f32 = 0.06;

/// Edges of the first net shorter than this, of a cell, are collapsed: where the surface grazes a grid plane, they would
/// make slivers that fold.
const SHORTEST: f32 = 0.3;

/// Rounds of evening out: each moves every vertex half-way to the mean of its neighbours and back onto the surface.
const ROUNDS: usize = 4;

/// Adds the rabbit, standing at `foot` with edges of about `edge` metres, looking to +z.
pub fn rabbit(draft: &mut Draft, paint: Paint, foot: Vec3, height: f32, edge: f32) {
    let cell = (edge / height).min(COARSEST);
    let (position, triangles) = net(cell);
    let (lo, hi) = position.iter().fold((f32::MAX, f32::MIN), |(lo, hi), p| (lo.min(p.y), hi.max(p.y)));
    let scale = height / (hi - lo);
    let placed: Vec<Vec3> = position.iter().map(|&p| foot + scale * (p - lo * Vec3::Y)).collect();
    let kept: Vec<[u32; 3]> = triangles.into_iter().filter(|t| has_area(t, &placed)).collect();
    // Of the faces, not of the gradient: in a tight fold the two can part by more than a right angle.
    draft.add(paint, &placed, &mean_normals(&kept, &placed), &kept);
}

/// Positive inside.
fn field(p: Vec3) -> f32 {
    let sum: f32 = BALLS.iter().map(|(centre, axes)| soft(((p - centre) / axes).length_squared())).sum();
    sum - LEVEL
}

fn soft(d2: f32) -> f32 {
    let rest = (1.0 - d2).max(0.0);
    rest * rest
}

fn gradient(p: Vec3) -> Vec3 {
    let one = |(centre, axes): &(Vec3, Vec3)| {
        let d = (p - centre) / axes;
        -4.0 * (1.0 - d.length_squared()).max(0.0) * d / axes
    };
    BALLS.iter().map(one).sum()
}

/// One Newton step along the gradient.
fn slide(p: Vec3) -> Vec3 {
    let g = gradient(p);
    p - field(p) * g / g.length_squared().max(1e-12)
}

/// The net: positions, and triangles with the outside in front.
fn net(cell: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    // All balls lie within these corners; one cell more on each side is outside.
    let (lo, hi) = (vec3(-0.5, -0.15, -0.7), vec3(0.5, 1.2, 0.75));
    let count = ((hi - lo) / cell).ceil().as_ivec3() + 1;
    let at = |c: IVec3| lo + cell * c.as_vec3();
    let index = |c: IVec3| ((c.z * (count.y + 1) + c.y) * (count.x + 1) + c.x) as usize;
    let corners: Vec<f32> = each(IVec3::ZERO, count + 1).map(|c| field(at(c))).collect();
    let mut net = Net::default();
    for c in each(IVec3::ONE, count) {
        for axis in [IVec3::X, IVec3::Y, IVec3::Z] {
            let [a, b] = [c, c + axis].map(|corner| corners[index(corner)]);
            if (a > 0.0) != (b > 0.0) {
                // The other two axes, in right-handed order; the four cells around this edge in their turn.
                let (u, v) = (ivec3(axis.z, axis.x, axis.y), ivec3(axis.y, axis.z, axis.x));
                let mut quad = [c - u - v, c - v, c, c - u];
                if b > 0.0 {
                    quad.reverse();
                }
                let crossing = at(c) + cell * a / (a - b) * axis.as_vec3();
                let quad = quad.map(|around| net.vertex(around, crossing));
                net.quads.push(quad);
            }
        }
    }
    let mut position: Vec<Vec3> = net.vertices.iter().map(|(sum, n)| sum / n).collect();
    collapse(&mut position, &mut net.quads, SHORTEST * cell);
    for _ in 0..ROUNDS {
        even_out(&mut position, &net.quads);
    }
    let triangles = net.quads.iter().flat_map(|&q| split(q, &position));
    let triangles: Vec<[u32; 3]> = triangles.filter(|&[a, b, c]| a != b && b != c && c != a).collect();
    compact(position, triangles)
}

/// Makes one vertex of both ends of each short edge, in the middle; no vertex takes part in two collapses.
fn collapse(position: &mut [Vec3], quads: &mut [[u32; 4]], shortest: f32) {
    let mut into: Vec<u32> = (0..position.len() as u32).collect();
    let mut taken = vec![false; position.len()];
    for quad in quads.iter() {
        for k in 0..4 {
            let (a, b) = (quad[k] as usize, quad[(k + 1) % 4] as usize);
            if !taken[a] && !taken[b] && position[a].distance(position[b]) < shortest {
                (taken[a], taken[b], into[b]) = (true, true, a as u32);
                position[a] = 0.5 * (position[a] + position[b]);
            }
        }
    }
    quads.iter_mut().flatten().for_each(|v| *v = into[*v as usize]);
}

/// Without the vertices that no triangle uses.
fn compact(position: Vec<Vec3>, mut triangles: Vec<[u32; 3]>) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut known = HashMap::new();
    let mut kept = Vec::new();
    for v in triangles.iter_mut().flatten() {
        *v = *known.entry(*v).or_insert_with(|| {
            kept.push(position[*v as usize]);
            kept.len() as u32 - 1
        });
    }
    (kept, triangles)
}

fn even_out(position: &mut [Vec3], quads: &[[u32; 4]]) {
    let mut around = vec![(Vec3::ZERO, 0.0); position.len()];
    for quad in quads {
        for k in 0..4 {
            let next = quad[(k + 1) % 4];
            if next == quad[k] {
                continue;
            }
            let (sum, n) = &mut around[quad[k] as usize];
            // The next corner is a neighbour; the one before is the next of the quadrilateral beside this.
            (*sum, *n) = (*sum + position[next as usize], *n + 1.0);
        }
    }
    for (p, (sum, n)) in position.iter_mut().zip(around) {
        if n > 0.0 {
            *p = slide(0.5 * (*p + sum / n));
        }
    }
}

#[derive(Default)]
struct Net {
    known: HashMap<IVec3, u32>,
    /// For each vertex the sum of the crossings on its cell's edges, and how many.
    vertices: Vec<(Vec3, f32)>,
    quads: Vec<[u32; 4]>,
}

impl Net {
    fn vertex(&mut self, cell: IVec3, crossing: Vec3) -> u32 {
        let vertex = *self.known.entry(cell).or_insert_with(|| {
            self.vertices.push((Vec3::ZERO, 0.0));
            self.vertices.len() as u32 - 1
        });
        let (sum, n) = &mut self.vertices[vertex as usize];
        (*sum, *n) = (*sum + crossing, *n + 1.0);
        vertex
    }
}

/// Every lattice point from `lo` up to, not with, `hi`; x fastest.
fn each(lo: IVec3, hi: IVec3) -> impl Iterator<Item = IVec3> {
    (lo.z..hi.z).flat_map(move |z| (lo.y..hi.y).flat_map(move |y| (lo.x..hi.x).map(move |x| ivec3(x, y, z))))
}
