//! Interiors lit through portals: a room of thin sheets whose direct light has a closed form, built-in scenes with
//! their glass taken out, and short ways to bake, relight and judge them.

use glam::{Vec2, Vec3, vec2};
use lunette_bake::{Basis, Options, PortalOptions, Silent, bake_portals};
use lunette_relight::asset::Asset;
use lunette_relight::cubemap::{n_texels, project_light};
use lunette_relight::indirect::Indirect;
use lunette_relight::light::Light;
use lunette_relight::portal_frame::PortalFrame;
use lunette_relight::shell::{Material, Shell};
use lunette_scenes::{Mesh, Portal, Scene, take_portals};

use crate::baked::scene;
use crate::sheets::{Facing, Sheets};

/// A scene without its glass, and the glass.
pub struct Interior {
    /// What is lit.
    pub scene: Scene,
    /// Through what.
    pub portals: Vec<Portal>,
}

/// A built-in scene whose materials `glass*` are portals.
///
/// # Panics
/// When there is no such scene, or no glass in it.
pub fn built(spec: &str) -> Interior {
    let mut scene = scene(spec);
    let portals = take_portals(&mut scene, &["glass*".to_string()]).expect("glass");
    Interior { scene, portals }
}

/// Inner size of [`room`], metres.
pub const ROOM: Vec3 = Vec3::new(4.0, 3.0, 5.0);

/// A rectangle in the wall z = 0 of [`room`], in x and y, metres.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Least x and y.
    pub low: Vec2,
    /// Greatest x and y.
    pub high: Vec2,
}

impl Window {
    /// All of the wall.
    pub const WALL: Window = Window { low: Vec2::ZERO, high: vec2(ROOM.x, ROOM.y) };

    /// A square in the middle of the wall.
    pub fn square(side: f32) -> Window {
        let middle = 0.5 * ROOM.truncate();
        Window { low: middle - 0.5 * side, high: middle + 0.5 * side }
    }

    /// m²
    pub fn area(&self) -> f32 {
        (self.high - self.low).element_product()
    }

    /// Its portal.
    ///
    /// # Panics
    /// When it has no area.
    pub fn portal(&self, name: &str) -> Portal {
        let Window { low: l, high: h } = *self;
        let corners = [l, vec2(h.x, l.y), h, vec2(l.x, h.y)].map(|c| c.extend(0.0));
        Portal::from_polygons(name, &[corners.to_vec()], Vec3::ONE).expect("an area")
    }
}

/// A box of sheets without thickness from the origin to [`ROOM`], facing inwards, `n` x `n` cells a wall, with a hole
/// in the wall z = 0 where there is a window. Nothing is in the way of the light.
pub fn room(window: Option<Window>, n: u32) -> Sheets {
    let mut sheets = Sheets::default();
    let (x, y, z) = (ROOM.x * Vec3::X, ROOM.y * Vec3::Y, ROOM.z * Vec3::Z);
    let Some(Window { low, high }) = window else {
        sheets.add_box(Vec3::ZERO, ROOM, Facing::Inwards, n);
        return sheets;
    };
    for (corner, u, v) in
        [(Vec3::ZERO, z, x), (Vec3::ZERO, y, z), (ROOM, -x, -z), (ROOM, -z, -y), (ROOM, -y, -x)]
    {
        sheets.add(corner, u, v, n);
    }
    // Around the hole: left, right, below, above.
    let parts = [
        (Vec2::ZERO, vec2(low.x, ROOM.y)),
        (vec2(high.x, 0.0), ROOM.truncate()),
        (vec2(low.x, 0.0), vec2(high.x, low.y)),
        (vec2(low.x, high.y), vec2(high.x, ROOM.y)),
    ];
    for (from, to) in parts.into_iter().filter(|(from, to)| (to - from).min_element() > 0.0) {
        sheets.add(from.extend(0.0), (to.x - from.x) * Vec3::X, (to.y - from.y) * Vec3::Y, n);
    }
    sheets
}

/// [`room`] with its window as the only portal, of this albedo.
pub fn room_with(window: Window, n: u32, albedo: f32) -> Interior {
    let mut scene = room(Some(window), n).scene();
    scene.materials[0].albedo = Vec3::splat(albedo);
    Interior { scene, portals: vec![window.portal("window")] }
}

/// Direct light alone, on small shells.
pub fn direct_options() -> Options {
    Options { bounces: 0, resolution: 16, rays: 256, ..Options::default() }
}

/// Bounced light in both ways.
pub fn bounced_options() -> Options {
    let basis = vec![Basis::Sh, Basis::DirectToIndirect];
    Options { basis, bounces: 4, indirect_order: 3, rays: 512, ..direct_options() }
}

impl Interior {
    /// Its bake.
    ///
    /// # Panics
    /// When that fails.
    pub fn baked(&self, options: &Options, portal_options: &PortalOptions) -> Asset<'static> {
        bake_portals(&self.scene, &self.portals, options, portal_options, &Silent).expect("a bake").0
    }

    /// Its bake by gathering.
    pub fn bake(&self, options: &Options) -> Asset<'static> {
        self.baked(options, &PortalOptions::default())
    }

    /// Its mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.scene.mesh
    }

    /// Vertices that lie inside a flat face, all around, and see the outside through portals alone.
    ///
    /// # Panics
    /// When Embree is missing.
    pub fn inner_vertices(&self) -> Vec<usize> {
        let inside = lunette_bake::openings::inside(&self.scene, &self.portals).expect("Embree");
        let flat = in_flat_faces(self.mesh());
        (0..flat.len()).filter(|&v| flat[v] && inside[v]).collect()
    }
}

/// Whether the triangles about each vertex go all around it in one plane.
pub fn in_flat_faces(mesh: &Mesh) -> Vec<bool> {
    let mut angle = vec![0.0f32; mesh.position.len()];
    for t in &mesh.index {
        let p = t.map(|v| mesh.position[v as usize]);
        let normal = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
        for i in 0..3 {
            let v = t[i] as usize;
            let is_flat = normal.dot(mesh.normal[v]) > 0.9999;
            // An angle that is not in the plane spoils the sum.
            let unit = if is_flat { 1.0 } else { f32::NAN };
            angle[v] += unit * (p[(i + 1) % 3] - p[i]).angle_between(p[(i + 2) % 3] - p[i]);
        }
    }
    angle.into_iter().map(|a| (a - std::f32::consts::TAU).abs() < 1e-3).collect()
}

/// Irradiance of every vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct Lit {
    /// Straight from the light, \[V\].
    pub direct: Vec<Vec3>,
    /// By way of other surfaces, \[V\].
    pub indirect: Vec<Vec3>,
}

impl Lit {
    /// Both together.
    pub fn total(&self) -> Vec<Vec3> {
        self.direct.iter().zip(&self.indirect).map(|(d, i)| d + i).collect()
    }
}

/// Irradiance through clear glass.
pub fn lit(asset: &Asset, light: &Light, indirect: Indirect) -> Lit {
    lit_through(asset, light, indirect, Material::CLEAR)
}

/// An asset under a light, with the same glass in every portal.
///
/// # Panics
/// When the asset has no portals or lacks that kind of bounced light.
pub fn frame_through<'a>(
    asset: &'a Asset<'a>,
    light: &Light,
    indirect: Indirect,
    glass: Material,
) -> PortalFrame<'a> {
    let mut frame = PortalFrame::new(asset).expect("portals");
    frame.set_indirect(indirect).expect("bounced light");
    let light = light.with_spots_as_discs();
    for k in 0..frame.n_portals() {
        let n = frame.resolution(k);
        let mut texels = vec![[0.0; 3]; n_texels(n)];
        project_light(&light, n, &mut texels);
        frame.set_material(k, glass);
        let discs: Vec<_> = light.discs().collect();
        let shell = Shell::new(n, &texels).expect("a shell");
        frame.set_shell_with_discs(k, shell, &discs).expect("its resolution");
    }
    frame
}

/// Irradiance with the same glass in every portal.
///
/// # Panics
/// When the asset has no portals or lacks that kind of bounced light.
pub fn lit_through(asset: &Asset, light: &Light, indirect: Indirect, glass: Material) -> Lit {
    let mut frame = frame_through(asset, light, indirect, glass);
    let mut direct = vec![[0.0; 3]; asset.n_vertices()];
    let mut indirect = direct.clone();
    frame.direct(0, &mut direct);
    frame.reflect(&direct);
    frame.add_indirect(0, &mut indirect);
    let vectors = |list: Vec<[f32; 3]>| list.into_iter().map(Vec3::from).collect();
    Lit { direct: vectors(direct), indirect: vectors(indirect) }
}
