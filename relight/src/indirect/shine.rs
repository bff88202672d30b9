//! Direct light that glossy patches send on by their lobes, and not evenly: a sun on a polished floor lights the ceiling.
//!
//! What a glossy vertex of specular reflectance Ks, exponent e and unit normal n makes of irradiance E from direction ω is,
//! about the mirror direction m = 2 (n·ω) n - ω,
//!
//! L(d) = Ks (e + 2)/(2π) E max(m·d, 0)^e, whose integral is P = Ks (e + 2)/(e + 1) E, and whose first moment is Ks E m.
//!
//! Of light from many directions both are sums, the moment being the mirrored one of the irradiance itself; of a node of
//! the tree they are the means over its vertices. A node is then taken to send out the lobe of the same kind that has that
//! integral and moment, a being the latter's direction and r its length in parts of P:
//!
//! L(d) = P (e' + 1)/(2π) max(a·d, 0)^e',   e' = (2 r - 1)/(1 - r),
//!
//! or, where that would be wider than a cosine, some of a cosine and the rest evenly. Each sun has its own
//! lobes, all else that comes through windows has one, and a row receives Σ over its links of what they are worth times
//! π L towards the row. Light that has bounced before is sent on evenly.
//!
//! Where it breaks: a node whose vertices face many ways sends out one broad lobe; and to whom it is near, it is a point.
//!
//! Based on: M. Toksvig, Mipmapping Normal Maps, 2005 (the width of a lobe by the length of a mean); the lobe is that of
//! Lafortune and Willems, see [`glossy`](crate::glossy).
#![allow(unsafe_code, reason = "the same code for wider vectors, twice as fast")]

use glam::Vec3;

use crate::asset::{Asset, Error};
use crate::block::{self, Blocks, LANES, Sums};
use crate::glossy::{GlossyVertex, glossy_vertices, mean_reflectance};
use crate::lobe::fast::{exp2, log2};

/// Narrowest lobe, as the length of its mean direction: finer than any exponent that is baked.
const NARROWEST: f32 = 0.995;

/// A cosine that stands for none: to the power of 1 and more it is nothing.
const BEHIND: f32 = 1e-9;

/// The glossy vertices of an asset among the nodes of a carrier.
#[derive(Clone, Debug)]
pub struct Shine {
    vertices: Vec<Shiny>,
    /// Middle of each node, metres.
    middle: Vec<Vec3>,
    /// Nodes with a glossy vertex, rising.
    nodes: Vec<u16>,
    /// Block b has the shiny links `start[b]..start[b + 1]`, and those are of all links.
    start: Vec<u32>,
    link: Vec<u32>,
    /// Of each node, and each source of light.
    sent: Vec<Sent>,
    lobes: Vec<Lobe>,
    n_sources: usize,
}

#[derive(Clone, Copy, Debug)]
struct Shiny {
    glossy: GlossyVertex,
    node: u16,
    /// What it is of its patch.
    part: f32,
    /// What it sends on of even light.
    even: Vec3,
    position: Vec3,
}

/// Integral, first moment of the sum of the colours, and that sum times where it is sent from, metres.
#[derive(Clone, Copy, Debug, Default)]
struct Sent {
    power: Vec3,
    moment: Vec3,
    place: Vec3,
}

#[derive(Clone, Copy, Debug, Default)]
struct Lobe {
    /// Sent out along the axis, beside what is sent evenly.
    most: Vec3,
    even: Vec3,
    axis: Vec3,
    exponent: f32,
    from: Vec3,
}

impl Shine {
    /// `part` is what each vertex is of its patch; `children` and `of_parent` describe the tree.
    ///
    /// # Errors
    /// When the glossy tensors do not hold together.
    pub fn open(
        asset: &Asset,
        (patch, part): (&[u16], &[f32]),
        (children, of_parent): (&[[u16; 2]], &[f32]),
        blocks: &Blocks,
    ) -> Result<Option<Shine>, Error> {
        let all = glossy_vertices(asset)?;
        let shiny = |glossy: GlossyVertex| {
            let v = glossy.vertex as usize;
            let node = patch[v];
            let even = glossy.specular * mean_reflectance(glossy.exponent);
            let position = asset.positions()[v].into();
            (usize::from(node) < children.len()).then_some(Shiny {
                glossy,
                node,
                part: part[v],
                even,
                position,
            })
        };
        let vertices: Vec<Shiny> = all.into_iter().filter_map(shiny).collect();
        if vertices.is_empty() {
            return Ok(None);
        }
        let mut is_shiny = vec![false; children.len()];
        vertices.iter().for_each(|v| is_shiny[usize::from(v.node)] = true);
        let mut middle = vec![Vec3::ZERO; children.len()];
        for ((node, part), p) in patch.iter().zip(part).zip(asset.positions()) {
            if let Some(middle) = middle.get_mut(usize::from(*node)) {
                *middle += *part * Vec3::from(*p);
            }
        }
        for node in (0..children.len()).rev() {
            let [l, r] = children[node].map(usize::from);
            if l > 0 {
                middle[node] = of_parent[l] * middle[l] + of_parent[r] * middle[r];
                is_shiny[node] = is_shiny[l] || is_shiny[r];
            }
        }
        let (mut start, mut link) = (vec![0], Vec::new());
        for pair in blocks.start.windows(2) {
            link.extend((pair[0]..pair[1]).filter(|&l| is_shiny[usize::from(blocks.entry[l as usize])]));
            start.push(link.len() as u32);
        }
        let nodes = (0..children.len()).filter(|&node| is_shiny[node]).map(|node| node as u16).collect();
        Ok(Some(Shine {
            vertices,
            middle,
            nodes,
            start,
            link,
            sent: Vec::new(),
            lobes: Vec::new(),
            n_sources: 0,
        }))
    }

    /// The vertices, rising.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = usize> {
        self.vertices.iter().map(|v| v.glossy.vertex as usize)
    }

    /// Vertex number `i` of them.
    pub fn vertex(&self, i: usize) -> usize {
        self.vertices[i].glossy.vertex as usize
    }

    /// Of each vertex its node, and what of its irradiance would count there as sent on evenly.
    pub fn even(&self) -> impl Iterator<Item = (usize, Vec3)> {
        self.vertices.iter().map(|v| (v.node.into(), v.part * v.even))
    }

    /// Forgets all light. Allocates where there are more sources than ever before.
    pub fn clear(&mut self, n_sources: usize) {
        self.n_sources = n_sources;
        let n = self.middle.len() * n_sources;
        self.sent.clear();
        self.lobes.clear();
        self.sent.resize(n, Sent::default());
        self.lobes.resize(n, Lobe::default());
    }

    /// Adds the light of a source: by number of the glossy vertex, and by that of the vertex, its irradiance and that times its direction, of the sum
    /// of the colours.
    pub fn add(&mut self, source: usize, light: impl Fn(usize, usize) -> (Vec3, Vec3)) {
        for (i, shiny) in self.vertices.iter().enumerate() {
            let (irradiance, moment) = light(i, shiny.glossy.vertex as usize);
            let GlossyVertex { specular, exponent, normal, .. } = shiny.glossy;
            let sent = &mut self.sent[usize::from(shiny.node) * self.n_sources + source];
            let power = shiny.part * (exponent + 2.0) / (exponent + 1.0) * specular * irradiance;
            sent.power += power;
            sent.place += power.element_sum() * shiny.position;
            // Of all colours together.
            let grey =
                (specular * irradiance).element_sum() / irradiance.element_sum().max(f32::MIN_POSITIVE);
            sent.moment += shiny.part * grey * (2.0 * normal.dot(moment) * normal - moment);
        }
    }

    /// Adds what is no beam, the first source, of which `moments` has all vertices.
    pub fn add_rest(&mut self, irradiance: &[Vec3], moments: &[[f32; 3]]) {
        self.add(0, |i, v| (irradiance[i].max(Vec3::ZERO), moments[v].into()));
    }

    /// Makes lobes of all light.
    pub fn finish(&mut self, children: &[[u16; 2]], of_parent: &[f32]) {
        for &node in self.nodes.iter().rev() {
            let node = usize::from(node);
            let [l, r] = children[node].map(usize::from);
            for source in 0..self.n_sources {
                let at = |node: usize| node * self.n_sources + source;
                if l > 0 {
                    let (left, right) = (self.sent[at(l)], self.sent[at(r)]);
                    self.sent[at(node)] = Sent {
                        power: of_parent[l] * left.power + of_parent[r] * right.power,
                        moment: of_parent[l] * left.moment + of_parent[r] * right.moment,
                        place: of_parent[l] * left.place + of_parent[r] * right.place,
                    };
                }
                self.lobes[at(node)] = Lobe::of(&self.sent[at(node)]);
            }
        }
    }

    /// Adds what the lobes send to the rows of block `b`, which lie there, but for the rows' scale.
    pub fn add_to(&self, b: usize, blocks: &Blocks, at: &[Vec3; LANES], sums: &mut Sums) {
        let at = [0, 1, 2].map(|axis| at.map(|p| p[axis]));
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has the features that `add_avx2` is compiled for.
            unsafe { self.add_avx2(b, blocks, &at, sums) };
            return;
        }
        self.add_portable(b, blocks, &at, sums);
    }

    /// The same code in wider vectors.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn add_avx2(&self, b: usize, blocks: &Blocks, at: &[[f32; LANES]; 3], sums: &mut Sums) {
        self.add_portable(b, blocks, at, sums);
    }

    #[inline(always)]
    fn add_portable(&self, b: usize, blocks: &Blocks, at: &[[f32; LANES]; 3], sums: &mut Sums) {
        for &link in &self.link[self.start[b] as usize..self.start[b + 1] as usize] {
            let node = usize::from(blocks.entry[link as usize]);
            let lobes = &self.lobes[node * self.n_sources..(node + 1) * self.n_sources];
            if lobes.iter().all(|lobe| lobe.exponent == 0.0) {
                continue;
            }
            let worth = blocks.share[link as usize].map(block::value);
            for lobe in lobes {
                let Lobe { most, even, axis, exponent, from } = *lobe;
                for i in 0..LANES {
                    let [x, y, z] = [at[0][i] - from.x, at[1][i] - from.y, at[2][i] - from.z];
                    let along = x * axis.x + y * axis.y + z * axis.z;
                    let cosine = along / (x * x + y * y + z * z).max(f32::MIN_POSITIVE).sqrt();
                    let sent = exp2(exponent * log2(cosine.max(BEHIND)));
                    sums[0][i] += worth[i] * (sent * most.x + even.x);
                    sums[1][i] += worth[i] * (sent * most.y + even.y);
                    sums[2][i] += worth[i] * (sent * most.z + even.z);
                }
            }
        }
    }

    /// Middle of a node, metres.
    pub fn middle(&self, node: usize) -> Vec3 {
        self.middle[node]
    }
}

impl Lobe {
    fn of(sent: &Sent) -> Lobe {
        let all = sent.power.element_sum();
        if all <= 0.0 {
            return Lobe::default();
        }
        let r = (sent.moment.length() / all).min(NARROWEST);
        let exponent = ((2.0 * r - 1.0) / (1.0 - r)).max(1.0);
        // Of a cosine's lobe r is 2/3.
        let share = (1.5 * r).min(1.0);
        // As all that leaves nodes is told: π times the radiance.
        Lobe {
            most: 0.5 * (exponent + 1.0) * share * sent.power,
            even: 0.25 * (1.0 - share) * sent.power,
            axis: sent.moment.normalize_or_zero(),
            exponent,
            from: sent.place / all,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    use glam::DVec3;

    fn sent(r: f32) -> Sent {
        let power = Vec3::new(1.0, 2.0, 3.0);
        let axis = Vec3::new(0.36, 0.48, 0.8);
        Sent { power, moment: r * power.element_sum() * axis, place: power.element_sum() * Vec3::X }
    }

    #[test]
    fn lobes_keep_integral_and_moment() {
        const SIDE: usize = 400;
        for r in [0.0, 0.3, 0.6, 2.0 / 3.0, 0.8, 0.95] {
            let (sent, lobe) = (sent(r), Lobe::of(&sent(r)));
            assert!((lobe.from - Vec3::X).length() < 1e-5);
            // Points spread evenly over the sphere's cylinder.
            let (mut integral, mut moment) = (DVec3::ZERO, DVec3::ZERO);
            for i in 0..SIDE * SIDE {
                let z = 2.0 * ((i / SIDE) as f32 + 0.5) / SIDE as f32 - 1.0;
                let (sine, cosine) = (2.0 * PI * ((i % SIDE) as f32 + 0.5) / SIDE as f32).sin_cos();
                let d = Vec3::new(cosine * (1.0 - z * z).sqrt(), sine * (1.0 - z * z).sqrt(), z);
                // π times the radiance.
                let l = lobe.most * d.dot(lobe.axis).max(0.0).powf(lobe.exponent) + lobe.even;
                let part = 4.0 / (SIDE * SIDE) as f32;
                integral += (part * l).as_dvec3();
                moment += (part * l.element_sum() * d).as_dvec3();
            }
            let (integral, moment) = (integral.as_vec3(), moment.as_vec3());
            // Of points 0.01 apart.
            assert!((integral - sent.power).length() < 1e-3 * sent.power.length(), "{r}: {integral}");
            assert!((moment - sent.moment).length() < 2e-3 * sent.power.element_sum(), "{r}: {moment}");
        }
    }

    #[test]
    fn wide_vectors_agree_with_narrow_ones() {
        let mut shine = Shine {
            vertices: Vec::new(),
            middle: vec![Vec3::ZERO; 3],
            nodes: vec![0, 2],
            start: vec![0, 2],
            link: vec![0, 2],
            sent: Vec::new(),
            lobes: Vec::new(),
            n_sources: 0,
        };
        shine.clear(2);
        for (i, r) in [0.9, 0.2, 0.0, 0.0, 0.7, 0.97].into_iter().enumerate() {
            shine.lobes[i] = if r > 0.0 { Lobe::of(&sent(r)) } else { Lobe::default() };
        }
        let share: Vec<[u8; LANES]> =
            (0..3).map(|l| std::array::from_fn(|i| (180 + 20 * l + 2 * i) as u8)).collect();
        let blocks = Blocks {
            start: &[0, 3],
            entry: &[0, 1, 2],
            share: &share,
            scale: &[std::array::from_fn(|i| 0.5 * (1.0 + i as f32))],
        };
        let at: [Vec3; LANES] = std::array::from_fn(|i| Vec3::new(i as f32, 3.0 - i as f32, 2.0));
        let split = [0, 1, 2].map(|axis| at.map(|p| p[axis]));
        let [mut any, mut plain] = [[[0.25; LANES]; 3]; 2];
        shine.add_to(0, &blocks, &at, &mut any);
        shine.add_portable(0, &blocks, &split, &mut plain);
        assert!(plain.as_flattened().iter().filter(|x| **x > 1e-3).count() > 20, "{plain:?}");
        for (a, b) in any.as_flattened().iter().zip(plain.as_flattened()) {
            assert!((a - b).abs() <= 1e-5 * b.abs(), "{a} {b}");
        }
    }
}
