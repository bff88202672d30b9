//! What glass does: none, some or all of the light, whichever way it goes on.

use glam::Vec3;
use lunette_relight::indirect::Indirect;
use lunette_relight::shell::Material;
use lunette_tests::baked::light;
use lunette_tests::interior::{Interior, Lit, Window, bounced_options, lit, lit_through, room_with};

const BOTH: [Indirect; 2] = [Indirect::Sh, Indirect::DirectToIndirect];

fn interior() -> Interior {
    room_with(Window::square(1.5), 4, 0.5)
}

const LIGHT: &str = "cie-overcast + cap:0.1,0.5,-1,0.15,20";

#[test]
fn closed_portal_is_exactly_dark() {
    let asset = interior().bake(&bounced_options());
    for indirect in BOTH {
        let closed = lit_through(&asset, &light(LIGHT), indirect, Material::CLOSED);
        assert_eq!(closed.total(), vec![Vec3::ZERO; asset.n_vertices()], "{indirect:?}");
        let open = lit(&asset, &light(LIGHT), indirect);
        assert!(open.indirect.iter().all(|e| e.min_element() > 0.0), "{indirect:?}: the open one is lit");
    }
}

#[test]
fn tint_multiplies_all_light() {
    let asset = interior().bake(&bounced_options());
    let through = |tint: Vec3, indirect| {
        let glass = Material { tint: tint.to_array(), frost: 0.0 };
        lit_through(&asset, &light(LIGHT), indirect, glass)
    };
    for indirect in BOTH {
        let clear = lit(&asset, &light(LIGHT), indirect);
        // Powers of two change no digit on the way, so that any difference is a mistake.
        let tint = Vec3::new(0.5, 0.25, 0.0);
        let tinted = |list: &[Vec3]| list.iter().map(|e| *e * tint).collect();
        let expected = Lit { direct: tinted(&clear.direct), indirect: tinted(&clear.indirect) };
        assert!(through(tint, indirect) == expected, "{indirect:?}");
        // Others round, a few times in single precision; a coefficient of either sign may cancel another.
        let tint = Vec3::new(0.9, 0.7, 0.3);
        let list = through(tint, indirect).total();
        for (v, (clear, tinted)) in clear.total().iter().zip(list).enumerate() {
            let off = (tinted - *clear * tint).abs().max_element();
            assert!(off <= 2e-5 * clear.max_element(), "{indirect:?}, vertex {v}: {clear} {tinted}");
        }
    }
}

#[test]
fn each_portal_has_glass_of_its_own() {
    use lunette_relight::portal_frame::PortalFrame;
    use lunette_relight::shell::Shell;

    let window = Window::square(1.5);
    let x = 0.5 * (window.low.x + window.high.x);
    let left = Window { high: glam::vec2(x, window.high.y), ..window };
    let right = Window { low: glam::vec2(x, window.low.y), ..window };
    let interior = Interior { portals: vec![left.portal("left"), right.portal("right")], ..interior() };
    let asset = interior.bake(&bounced_options());
    let lit = |open: [bool; 2]| {
        let mut frame = PortalFrame::new(&asset).expect("portals");
        frame.set_indirect(Indirect::DirectToIndirect).expect("it was baked");
        let texels = vec![[1.0f32; 3]; 6 * 16 * 16];
        for (k, open) in open.into_iter().enumerate() {
            frame.set_material(k, if open { Material::CLEAR } else { Material::CLOSED });
            frame.set_shell(k, Shell::new(16, &texels).expect("a shell")).expect("its resolution");
        }
        let mut out = vec![[0.0; 3]; asset.n_vertices()];
        frame.irradiance_parallel(&mut out);
        out
    };
    let [both, one, other] = [[true, true], [true, false], [false, true]].map(lit);
    assert_ne!(one, other);
    for v in 0..both.len() {
        // Light adds up, in single precision.
        let off = (both[v][0] - one[v][0] - other[v][0]).abs();
        assert!(off < 1e-5 * both[v][0].max(0.1), "vertex {v}: {} {} {}", both[v][0], one[v][0], other[v][0]);
        assert!(one[v][0] > 0.0 && other[v][0] > 0.0);
    }
}
