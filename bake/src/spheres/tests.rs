use glam::{Vec3, vec3};

use super::{SphereError, SphereOptions, fit_spheres};

/// A closed surface of revolution-like make: a sphere of `n` × 2n quadrilaterals, moved by a map.
fn ball(n: usize, map: impl Fn(Vec3) -> Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let columns = 2 * n;
    let at = |i: usize, j: usize| {
        let (theta, phi) =
            (i as f32 / n as f32 * std::f32::consts::PI, j as f32 / columns as f32 * std::f32::consts::TAU);
        map(vec3(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin()))
    };
    let position = (0..=n).flat_map(|i| (0..columns).map(move |j| at(i, j))).collect();
    let quad = |i: usize, j: usize| {
        let corner = |di: usize, dj: usize| ((i + di) * columns + (j + dj) % columns) as u32;
        [[corner(0, 0), corner(1, 0), corner(1, 1)], [corner(0, 0), corner(1, 1), corner(0, 1)]]
    };
    let index = (0..n).flat_map(|i| (0..columns).flat_map(move |j| quad(i, j))).collect();
    (position, index)
}

fn options(n_spheres: usize) -> SphereOptions {
    SphereOptions { n_spheres, resolution: 40 }
}

#[test]
fn one_sphere_fits_a_ball() {
    let (position, index) = ball(32, |p| p * 2.0 + vec3(5.0, -1.0, 0.3));
    let fit = fit_spheres(&position, &index, &options(1)).unwrap();
    let sphere = fit.set.spheres()[0];
    // A cell is 0.1 m; the fit settles to a quarter of one, and the ball has flat faces.
    assert!((sphere.radius - 2.0).abs() < 0.04, "{sphere:?}");
    assert!(sphere.centre.distance(vec3(5.0, -1.0, 0.3)) < 0.05);
    assert!((fit.volume / 33.51 - 1.0).abs() < 0.02, "{}", fit.volume);
    assert!(fit.outside < 0.04 && fit.missing < 0.04 && fit.surface < 0.01, "{fit:?}");
}

#[test]
fn more_spheres_fit_better() {
    // A bent, dented body.
    let bend = |p: Vec3| vec3(p.x * 1.5, 0.5 * p.y + 0.6 * p.x * p.x, p.z * (0.5 + 0.2 * p.x));
    let (position, index) = ball(32, bend);
    let error = |n| {
        let fit = fit_spheres(&position, &index, &options(n)).unwrap();
        assert!(fit.set.spheres().len() <= n);
        fit.outside + fit.missing
    };
    let errors = [4, 16, 64].map(error);
    println!("error at 4, 16 and 64 spheres: {errors:.3?}");
    assert!(errors[1] < 0.7 * errors[0] && errors[2] < 0.8 * errors[1]);
    // 64 spheres at a cell of a thirtieth of the body.
    assert!(errors[2] < 0.12, "{errors:?}");
}

#[test]
fn orientation_and_holes_do_not_matter() {
    let (position, mut index) = ball(24, |p| p);
    let volume = |index: &[[u32; 3]]| fit_spheres(&position, index, &options(1)).unwrap().volume;
    let whole = volume(&index);
    index.iter_mut().for_each(|t| t.swap(0, 1));
    assert_eq!(volume(&index), whole);
    // Every other triangle turned: parity decides.
    index.iter_mut().step_by(2).for_each(|t| t.swap(0, 1));
    assert!((volume(&index) / whole - 1.0).abs() < 0.02);
    // A hole at one pole.
    let (_, index) = ball(24, |p| p);
    let open: Vec<[u32; 3]> = index[5 * 48 * 2..].to_vec();
    assert!((volume(&open) / whole - 1.0).abs() < 0.1, "{} of {whole}", volume(&open));
}

#[test]
fn the_same_mesh_gives_the_same_spheres() {
    let (position, index) = ball(16, |p| p * vec3(1.0, 0.5, 0.3));
    let fit = || fit_spheres(&position, &index, &options(12)).unwrap().set;
    assert_eq!(fit(), fit());
}

#[test]
fn meshes_without_volume_are_refused() {
    let flat = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 1.0)];
    let error =
        |position: &[Vec3], index: &[[u32; 3]]| fit_spheres(position, index, &options(8)).unwrap_err();
    assert_eq!(error(&flat, &[[0, 2, 1], [1, 2, 3]]), SphereError::NoVolume);
    assert_eq!(error(&[Vec3::ONE; 3], &[[0, 1, 2]]), SphereError::NoVolume);
    assert_eq!(error(&flat, &[]), SphereError::NoTriangle);
    assert_eq!(error(&flat, &[[0, 1, 4]]), SphereError::Index(0));
    assert_eq!(error(&[Vec3::NAN; 3], &[[0, 1, 2]]), SphereError::NotFinite(0));
    let none = SphereOptions { n_spheres: 0, ..SphereOptions::default() };
    let refused = fit_spheres(&flat, &[[0, 1, 2]], &none).unwrap_err();
    assert!(matches!(refused, SphereError::Option(_)) && !refused.to_string().contains('\n'));
    // A tilted sheet, which rays along every axis cross.
    let tilted = [vec3(0.0, 0.0, 0.0), vec3(1.0, 1.0, 0.0), vec3(0.0, 1.0, 1.0)];
    assert_eq!(error(&tilted, &[[0, 1, 2]]), SphereError::NoVolume);
}

#[test]
fn rabbit_fits_in_sixty_four_spheres() {
    // The mesh holds the whole room; only the rabbit's triangles are given.
    let scene = lunette_scenes::builtin::build("box-room").unwrap();
    let group = scene.groups.iter().position(|name| name == "rabbit").unwrap() as u32;
    let faces = scene.mesh.index.iter().zip(&scene.mesh.group).filter(|(_, g)| **g == group);
    let index: Vec<[u32; 3]> = faces.map(|(t, _)| *t).collect();
    let errors = [16, 64].map(|n_spheres| {
        let options = SphereOptions { n_spheres, ..SphereOptions::default() };
        let fit = fit_spheres(&scene.mesh.position, &index, &options).unwrap();
        println!(
            "{n_spheres}: outside {:.3}, missing {:.3}, surface {:.4}",
            fit.outside, fit.missing, fit.surface
        );
        fit.outside + fit.missing
    });
    // 3 % of the volume is wrong with 64 spheres; a cell of the grid is 1.4 % of the height.
    assert!(errors[1] < 0.05 && errors[1] < 0.6 * errors[0], "{errors:?}");
}
