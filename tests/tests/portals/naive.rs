//! Direct rows against brute-force rays through the glass, in a room with thick walls and a rabbit in the way.

use glam::Vec3;
use lunette_bake::Options;
use lunette_relight::cubemap::{n_texels, project_light, texel_of};
use lunette_relight::indirect::Indirect;
use lunette_tests::baked::light;
use lunette_tests::brute::{Estimate, Oracle};
use lunette_tests::interior::{built, direct_options, lit};
use lunette_tests::measure::{mean, spread};

/// A smooth sky that is brightest beside the window, and a disc that falls in steeply.
const LIGHTS: [&str; 2] = ["cie-overcast + cap:-0.5,0.4,0.8,1.2,2", "cap:-1,0.2,0.1,0.3,30"];

/// Bakes of other seeds.
const N_SEEDS: usize = 6;

/// What a row may be off by, whatever the seed, as a share of it. A piece of a texel of which the first few rays see all,
/// or nothing, is taken at their word: that tells where the view grazes the sill. The encoding adds 1 %.
const SYSTEMATIC: f64 = 0.05;

#[test]
fn rows_agree_with_brute_force_through_the_glass() {
    let room = built("box-room:edge=0.7");
    let panes: Vec<[Vec3; 3]> = room.portals.iter().flat_map(|p| p.triangles.iter().copied()).collect();
    let options = direct_options();
    let bakes: Vec<[Vec<Vec3>; 2]> = (0..N_SEEDS)
        .map(|seed| {
            let asset = room.bake(&Options { seed: seed as u64, ..options.clone() });
            LIGHTS.map(|spec| lit(&asset, &light(spec), Indirect::None).direct)
        })
        .collect();
    // The oracle sees the light in texels, as a shell is: its resolution is not under test here.
    let shells = LIGHTS.map(|spec| {
        let mut texels = vec![[0.0; 3]; n_texels(options.resolution)];
        project_light(&light(spec), options.resolution, &mut texels);
        texels
    });
    let inner = room.inner_vertices();
    let oracle = Oracle::new(room.mesh());
    let mut compared = [vec![], vec![]];
    for v in spread(inner.len(), 20).map(|i| inner[i]) {
        let (p, n) = (room.mesh().position[v], room.mesh().normal[v]);
        let radiance = |d| {
            let t = texel_of(options.resolution, d);
            [0, 1].map(|i| f64::from(shells[i][t][0]))
        };
        for (i, truth) in oracle.through((p, n), &panes, 160, radiance).into_iter().enumerate() {
            let found = Estimate::of(bakes.iter().map(|bake| f64::from(bake[i][v].x)));
            if truth.mean == 0.0 {
                // What 400 000 rays do not find is not there, but for a crack.
                assert!(found.mean < 1e-3, "{p} under {}: {found:?}", LIGHTS[i]);
                continue;
            }
            let off = found.mean - truth.mean;
            // Student's t with five degrees of freedom, 40 values: 6 is exceeded with probability 0.04 if all of the
            // error were the bake's noise, and the systematic part is left for what it is.
            let allowed = 6.0 * truth.error.hypot(found.error) + SYSTEMATIC * truth.mean;
            assert!(off.abs() < allowed, "{p} under {}: {found:?} {truth:?}", LIGHTS[i]);
            assert!(truth.error.hypot(found.error) < 0.05 * truth.mean.max(0.02), "{p}: nothing is judged");
            compared[i].push((off, truth.mean));
        }
    }
    for (list, spec) in compared.into_iter().zip(LIGHTS) {
        assert!(list.len() >= 4, "too few vertices are lit under {spec}: {}", list.len());
        let bias = mean(list.iter().map(|c| c.0)) / mean(list.iter().map(|c| c.1));
        let relative = mean(list.iter().map(|c| c.0.abs())) / mean(list.iter().map(|c| c.1));
        println!("{} vertices under {spec}: {relative:.4}, bias {bias:.4}", list.len());
        // Over all vertices it evens out.
        assert!(relative < 0.02, "{spec}: {relative}");
        assert!(bias.abs() < 0.015, "{spec}: {bias}");
    }
}
