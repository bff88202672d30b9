//! Rays per second of a bake against a bare loop over the same rays.
//!
//! The bare loop only copies ready-made packets and asks Embree for occlusion, 8 and 16 wide; the faster one
//! counts. The bake makes the rays, and sums ambient occlusion, bent normal, aperture and order-5 SH. Both run on
//! one thread, in turns. Target: 0.9.
//!
//!     cargo bench -p lunette-benches --bench bake

use std::hint::black_box;

use lunette_bake::{HemisphereSets, LANES, Options, Silent, Surface, bake};
use lunette_benches::duel;
use lunette_ffi::{Lanes, Mask, Packet, Width};
use lunette_scenes::Scene;

/// Rays of each vertex, as by default.
const RAYS: usize = 256;
const ROUNDS: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    lunette_ffi::flush_to_zero();
    println!("{:<24} {:>9} {:>8} {:>8} {:>7}", "scene", "M rays", "bare", "bake", "ratio");
    for name in ["terrain:n=128", "courtyard:edge=0.7", "chapel:edge=1"] {
        measure(name, &lunette_scenes::builtin::build(name)?)?;
    }
    Ok(())
}

fn measure(name: &str, scene: &Scene) -> Result<(), Box<dyn std::error::Error>> {
    let surface = Surface::new(scene)?;
    let (eight, sixteen) = (packets::<8>(&surface), packets::<16>(&surface));
    let options = Options { rays: RAYS, bounces: 0, threads: 1, seed: 1, ..Options::default() };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .start_handler(|_| lunette_ffi::flush_to_zero())
        .build()?;
    let (by_eight, by_sixteen) =
        duel(3, || pool.install(|| bare(&surface, &eight)), || pool.install(|| bare(&surface, &sixteen)));
    let bare = || if by_eight < by_sixteen { bare(&surface, &eight) } else { bare(&surface, &sixteen) };
    let (bare, bake) =
        duel(ROUNDS, || pool.install(bare), || drop(black_box(bake(scene, &options, &Silent))));
    let rays = (scene.mesh.position.len() * RAYS) as f64 / 1e6;
    println!("{name:<24} {rays:>9.1} {:>8.2} {:>8.2} {:>7.2}", rays / bare, rays / bake, bare / bake);
    Ok(())
}

/// The rays of a bake, `N` to a packet.
fn packets<const N: usize>(surface: &Surface) -> Vec<Packet<N>> {
    let sets = HemisphereSets::new(RAYS, 1);
    let mut packets = Vec::new();
    for (v, origin) in surface.origin.iter().enumerate() {
        let (set, frame) = sets.at(v, surface.mesh.normal[v]);
        for local in set {
            for first in (0..LANES).step_by(N) {
                let mut packet = Packet::<N>::default();
                for lane in 0..N {
                    let i = first + lane;
                    let d = frame.to_world(glam::Vec3::new(local.x[i], local.y[i], local.z[i]));
                    packet.set(lane, &lunette_ffi::Ray::new(origin.to_array(), d.to_array()));
                }
                packets.push(packet);
            }
        }
    }
    packets
}

fn bare<const N: usize>(surface: &Surface, packets: &[Packet<N>])
where
    Lanes<N>: Width,
{
    for packet in packets {
        let mut rays = *packet;
        surface.tree.occluded_packet(&Mask::all(), &mut rays);
        black_box(&rays.tfar);
    }
}
