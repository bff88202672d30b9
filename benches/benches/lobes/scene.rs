//! The plane, the rabbit and the lamp.

use glam::{Quat, Vec3};
use lunette_bake::{SphereOptions, fit_spheres};
use lunette_relight::lobe::{
    Blockers, Lamp, Motion, Options, Points, Policy, Scene, Scratch, SphereSet, Target, add_irradiance,
};
use lunette_scenes::builtin;

/// Heights of the rabbit's feet over the plane, metres; the rabbit is 1 m high.
pub const HEIGHTS: [f32; 3] = [0.0, 0.6, 1.2];
/// Side of the plane, metres.
const SIDE: f32 = 5.0;

/// The rabbit of the built-in room as 64 spheres, 1 m high, feet at the origin.
pub fn rabbit() -> SphereSet {
    let scene = builtin::build("box-room").expect("a built-in scene");
    let group = scene.groups.iter().position(|name| name == "rabbit").expect("the room has a rabbit") as u32;
    let of_rabbit = |(_, g): &(&[u32; 3], &u32)| **g == group;
    let index: Vec<[u32; 3]> =
        scene.mesh.index.iter().zip(&scene.mesh.group).filter(of_rabbit).map(|(t, _)| *t).collect();
    let corners = || index.iter().flatten().map(|&v| scene.mesh.position[v as usize]);
    let low = corners().fold(Vec3::INFINITY, Vec3::min);
    let high = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
    let foot = (0.5 * (low + high)).with_y(low.y);
    let position: Vec<Vec3> = scene.mesh.position.iter().map(|p| (p - foot) / (high.y - low.y)).collect();
    let started = std::time::Instant::now();
    let fit = fit_spheres(&position, &index, &SphereOptions::default()).expect("the rabbit has a volume");
    println!(
        "rabbit: {} triangles, {} spheres in {:.2} s; outside {:.1} %, missing {:.1} %, surface {:.2} % of diagonal",
        index.len(),
        fit.set.spheres().len(),
        started.elapsed().as_secs_f64(),
        100.0 * fit.outside,
        100.0 * fit.missing,
        100.0 * fit.surface
    );
    fit.set
}

/// n × n points on the plane y = 0, facing up.
pub struct Plane {
    pub position: Vec<[f32; 3]>,
    pub normal: Vec<[f32; 3]>,
}

pub fn plane(n: usize) -> Plane {
    let at = |i: usize| ((i as f32 + 0.5) / n as f32 - 0.5) * SIDE;
    let position = (0..n * n).map(|k| [at(k % n), 0.0, at(k / n)]).collect();
    Plane { position, normal: vec![[0.0, 1.0, 0.0]; n * n] }
}

pub fn lamp() -> Lamp {
    Lamp::new(Vec3::new(1.2, 5.0, 0.8), 0.4, Vec3::ONE).expect("a lamp")
}

pub fn blockers(body: &SphereSet, height: f32) -> Blockers {
    let mut blockers = Blockers::default();
    let motion = Motion { rotation: Quat::from_rotation_y(0.4), translation: Vec3::Y * height };
    blockers.push(body, &motion);
    blockers
}

/// The paper's options: partly hidden cells shine.
pub fn aggressive() -> Options {
    Options { policy: Policy::Aggressive, threshold: 1e-3, ..Options::default() }
}

/// One frame, by as many threads as there are scratches; slices are dealt in turn, so that shadows are shared.
pub fn frame(
    plane: &Plane,
    blockers: &Blockers,
    options: &Options,
    scratch: &mut [Scratch],
    light: &mut [[f32; 3]],
) {
    let lamps = [lamp()];
    let scene = Scene { lamps: &lamps, blockers };
    let n_threads = scratch.len();
    let points = plane.position.chunks(SLICE).zip(plane.normal.chunks(SLICE));
    if let [one] = scratch {
        let points = Points { position: &plane.position, normal: &plane.normal };
        add_irradiance(&points, &scene, options, one, &mut Target { light, products: None });
        return;
    }
    let mut hands: Vec<Vec<_>> = (0..n_threads).map(|_| Vec::new()).collect();
    for (k, ((position, normal), light)) in points.zip(light.chunks_mut(SLICE)).enumerate() {
        hands[k % n_threads].push((Points { position, normal }, light));
    }
    std::thread::scope(|scope| {
        for (hand, scratch) in hands.into_iter().zip(scratch) {
            let scene = &scene;
            scope.spawn(move || {
                for (points, light) in hand {
                    let mut target = Target { light, products: None };
                    add_irradiance(&points, scene, options, scratch, &mut target);
                }
            });
        }
    });
}

/// Points dealt to a thread at once.
const SLICE: usize = 512;
