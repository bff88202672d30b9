//! What rays hit: known answers, packets against single rays, threads, odd rays.

mod random;

use lunette_ffi::{Device, Hit, Hits, Lanes, Mask, Packet, Ray, Scene, SceneBuilder, Width};
use random::Random;

fn scene_of(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Scene {
    let device = Device::new().expect("Embree");
    let mut builder = SceneBuilder::new(&device).expect("scene");
    assert_eq!(builder.add_triangles(positions, indices), Ok(0));
    builder.commit().expect("commit")
}

/// 500 small triangles strewn through the cube from -1 to 1.
fn soup() -> Scene {
    let mut random = Random(7);
    let triangle = |random: &mut Random| {
        let centre = random.point();
        [(); 3].map(|()| random.point()).map(|p| std::array::from_fn(|k| centre[k] + 0.2 * p[k]))
    };
    let positions: Vec<[f32; 3]> = (0..500).flat_map(|_| triangle(&mut random)).collect();
    let indices: Vec<[u32; 3]> = (0..500).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    scene_of(&positions, &indices)
}

fn random_rays(n_rays: usize) -> Vec<Ray> {
    let mut random = Random(11);
    let ray =
        |random: &mut Random| Ray { tfar: 4.0 * random.next(), ..Ray::new(random.point(), random.point()) };
    (0..n_rays).map(|_| ray(&mut random)).collect()
}

#[test]
fn triangle_hit_has_known_distance_weights_and_normal() {
    // The second of two triangles in the plane z = 2, seen from below and from above.
    let positions = [[9.0, 9.0, 2.0], [0.0, 0.0, 2.0], [4.0, 0.0, 2.0], [0.0, 2.0, 2.0]];
    let scene = scene_of(&positions, &[[0, 2, 3], [1, 2, 3]]);
    // Powers of two throughout, so that single precision is exact, but that Embree divides by a reciprocal that the
    // processor approximates, makers each in their way: the last bits differ.
    let is = |ray: &Ray, t: f32| {
        let hit = scene.intersect(ray).expect("a hit");
        let near = |a: f32, b: f32| (a - b).abs() < b * 4.0 * f32::EPSILON;
        assert!(near(hit.t, t) && near(hit.u, 0.25) && near(hit.v, 0.5), "{hit:?}");
        let same = Hit {
            t: hit.t,
            u: hit.u,
            v: hit.v,
            normal: [0.0, 0.0, 8.0],
            primitive: 1,
            geometry: 0,
            instance: None,
        };
        assert_eq!(hit, same, "the normal does not turn towards the ray");
    };
    let up = Ray::new([1.0, 1.0, 0.0], [0.0, 0.0, 0.5]);
    is(&up, 4.0);
    let down = Ray::new([1.0, 1.0, 3.0], [0.0, 0.0, -1.0]);
    is(&down, 1.0);
    assert!(scene.occluded(&up) && scene.occluded(&down));
}

#[test]
fn ray_range_cuts_hits_off() {
    let scene = scene_of(&[[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [0.0, 1.0, 2.0]], &[[0, 1, 2]]);
    let up = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    for (ray, is_hit) in [
        (up, true),
        (Ray { tfar: 2.5, ..up }, true),
        (Ray { tfar: 1.5, ..up }, false),
        (Ray { tnear: 2.5, ..up }, false),
        (Ray { tnear: 1.0, tfar: 0.5, ..up }, false),
        (Ray { direction: [0.0, 0.0, -1.0], ..up }, false),
        (Ray { origin: [0.9, 0.9, 0.0], ..up }, false),
    ] {
        assert_eq!(scene.intersect(&ray).is_some(), is_hit, "{ray:?}");
        assert_eq!(scene.occluded(&ray), is_hit, "{ray:?}");
    }
}

#[test]
fn empty_scene_is_hit_by_nothing() {
    let device = Device::new().expect("Embree");
    let scene = SceneBuilder::new(&device).and_then(SceneBuilder::commit).expect("empty scene");
    let ray = Ray::new([0.0; 3], [0.0, 1.0, 0.0]);
    assert!(scene.intersect(&ray).is_none() && !scene.occluded(&ray));
}

fn check_packets<const N: usize>(scene: &Scene, rays: &[Ray])
where
    Lanes<N>: Width,
{
    let (mut packet, mut hits) = (Packet::<N>::default(), Hits::default());
    let mut n_hits = 0;
    for chunk in rays.chunks(N) {
        let valid = Mask::first(chunk.len());
        let fill = |packet: &mut Packet<N>| {
            chunk.iter().enumerate().for_each(|(lane, ray)| packet.set(lane, ray));
        };
        fill(&mut packet);
        scene.intersect_packet(&valid, &mut packet, &mut hits);
        for (lane, ray) in chunk.iter().enumerate() {
            let (single, hit) = (scene.intersect(ray), hits.get(&packet, lane));
            assert_same(ray, single, hit);
            n_hits += usize::from(single.is_some());
        }
        fill(&mut packet);
        scene.occluded_packet(&valid, &mut packet);
        for (lane, ray) in chunk.iter().enumerate() {
            assert_eq!(packet.is_occluded(lane), scene.occluded(ray), "{ray:?}");
        }
    }
    assert!(n_hits > rays.len() / 10 && n_hits < rays.len(), "{n_hits} hits prove little");
}

/// Single rays and packets are different code in Embree, and round differently.
fn assert_same(ray: &Ray, single: Option<Hit>, packet: Option<Hit>) {
    /// Some tens of roundings of numbers around 1.
    const TOLERANCE: f32 = 1e-4;
    let id = |hit: Hit| (hit.primitive, hit.geometry, hit.instance);
    assert_eq!(single.map(id), packet.map(id), "{ray:?}");
    if let (Some(a), Some(b)) = (single, packet) {
        assert!((a.t - b.t).abs() <= TOLERANCE * a.t.abs().max(1.0), "{a:?} {b:?}");
        assert!((a.u - b.u).abs() <= TOLERANCE && (a.v - b.v).abs() <= TOLERANCE, "{a:?} {b:?}");
        assert!((0..3).all(|k| (a.normal[k] - b.normal[k]).abs() <= TOLERANCE), "{a:?} {b:?}");
    }
}

#[test]
fn packets_of_8_and_16_find_what_single_rays_find() {
    let scene = soup();
    // Not a multiple of either width, so that the last packet is partly off.
    let rays = random_rays(100_003);
    check_packets::<8>(&scene, &rays);
    check_packets::<16>(&scene, &rays);
}

#[test]
fn lanes_that_are_off_are_left_alone() {
    let scene = scene_of(&[[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [0.0, 9.0, 2.0]], &[[0, 1, 2]]);
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let (mut packet, mut hits) = (Packet::<16>::default(), Hits::default());
    for pattern in [0u32, 1, 0x8000, 0xaaaa, 0x7fff, 0xffff] {
        let is_on = |lane: usize| pattern >> lane & 1 == 1;
        let mask = Mask::from_fn(is_on);
        (0..16).for_each(|lane| packet.set(lane, &ray));
        scene.intersect_packet(&mask, &mut packet, &mut hits);
        for lane in 0..16 {
            assert_eq!(hits.get(&packet, lane).is_some(), is_on(lane), "{pattern:x} {lane}");
            assert_eq!(packet.tfar[lane], if is_on(lane) { 2.0 } else { f32::INFINITY });
        }
        (0..16).for_each(|lane| packet.set(lane, &ray));
        scene.occluded_packet(&mask, &mut packet);
        assert!((0..16).all(|lane| packet.is_occluded(lane) == is_on(lane)));
    }
}

#[test]
fn rays_with_bad_numbers_do_no_harm_to_their_neighbours() {
    let scene = soup();
    let good = random_rays(4000);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, f32::MAX, 1e-42];
    let (mut packet, mut hits) = (Packet::<8>::default(), Hits::default());
    for (round, chunk) in good.chunks_exact(4).enumerate() {
        let number = bad[round % bad.len()];
        for (lane, ray) in chunk.iter().enumerate() {
            let mut spoilt = *ray;
            if round % 2 == 0 {
                spoilt.direction = [number; 3]
            } else {
                spoilt.origin[round % 3] = number
            }
            packet.set(2 * lane, ray);
            packet.set(2 * lane + 1, &spoilt);
            scene.intersect(&spoilt);
            scene.occluded(&spoilt);
        }
        scene.intersect_packet(&Mask::all(), &mut packet, &mut hits);
        for (lane, ray) in chunk.iter().enumerate() {
            assert_same(ray, scene.intersect(ray), hits.get(&packet, 2 * lane));
        }
    }
}

#[test]
fn threads_share_a_scene_and_agree() {
    let scene = soup();
    let rays = random_rays(20_000);
    let trace = || rays.iter().map(|ray| (scene.intersect(ray), scene.occluded(ray))).collect::<Vec<_>>();
    let expected = trace();
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8).map(|_| scope.spawn(trace)).collect();
        threads.into_iter().for_each(|thread| assert!(thread.join().expect("thread") == expected));
    });
}

#[test]
fn devices_and_scenes_are_made_and_dropped_on_many_threads() {
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| (0..3).for_each(|_| drop(soup())));
        }
    });
    // A scene outlives the last handle to its device that others hold.
    let scene = soup();
    assert!(random_rays(1000).iter().any(|ray| scene.occluded(ray)));
}

#[test]
fn rebuilt_scene_gives_bit_identical_hits() {
    let rays = random_rays(20_000);
    let trace = |scene: Scene| rays.iter().map(|ray| scene.intersect(ray)).collect::<Vec<_>>();
    let expected = trace(soup());
    (0..5).for_each(|_| assert!(trace(soup()) == expected));
}
