//! Which materials are glossy, and how much they may reflect.
//!
//! A material with a `Ks` is *glossy* where its Phong exponent is low enough for whoever shades it, and *matt* else.
//! `Kd + Ks` above 1 in a channel would send back more light than falls in; exporters write it all the same, so that
//! `Ks` is cut to `1 - Kd` there.

use glam::Vec3;

use crate::names::{count, some};
use crate::scene::{Material, Scene};

/// Sums of reflectances this far over 1 are rounding of a file's decimals.
const MARGIN: f32 = 1e-3;

/// A Phong lobe: `specular (exponent + 2)/(2π) max(r·ω, 0)^exponent`, 1/sr, r being the viewer's mirror direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lobe {
    /// Share of light that the lobe sends back from straight above; with the albedo no more than 1.
    pub specular: Vec3,
    /// 0 and up.
    pub exponent: f32,
}

impl Material {
    /// What it reflects beside its albedo, if it is glossy and its exponent is at most `highest`.
    pub fn lobe(&self, highest: f32) -> Option<Lobe> {
        let specular = self.specular.min(Vec3::ONE - self.albedo).max(Vec3::ZERO);
        let is_glossy = specular != Vec3::ZERO && self.exponent <= highest;
        is_glossy.then_some(Lobe { specular, exponent: self.exponent })
    }
}

impl Scene {
    /// The lobe of each vertex, \[V\]: that of its material; one without reflectance where it is matt.
    pub fn vertex_lobes(&self, highest: f32) -> Vec<Lobe> {
        let lobes: Vec<Lobe> = self.materials.iter().map(|m| m.lobe(highest).unwrap_or_default()).collect();
        let mut of_vertex = vec![Lobe::default(); self.mesh.position.len()];
        for (triangle, &material) in self.mesh.index.iter().zip(&self.mesh.material) {
            for &v in triangle {
                of_vertex[v as usize] = lobes[material as usize];
            }
        }
        of_vertex
    }

    /// What is worth telling of its glossy materials: which are too sharp, which had to be darkened. Only of those
    /// that some triangle has.
    pub fn gloss_report(&self, highest: f32) -> Vec<String> {
        let mut is_used = vec![false; self.materials.len()];
        self.mesh.material.iter().for_each(|&m| is_used[m as usize] = true);
        let with = |condition: &dyn Fn(&Material) -> bool| -> Vec<String> {
            let used = self.materials.iter().zip(&is_used).filter(|(_, used)| **used);
            let opaque = used.filter(|(m, _)| m.specular != Vec3::ZERO && m.transmission == Vec3::ZERO);
            opaque.filter(|(m, _)| condition(m)).map(|(m, _)| m.name.clone()).collect()
        };
        let mut report = Vec::new();
        let mut tell = |names: &[String], what: String| {
            if !names.is_empty() {
                report.push(format!("{} {what}: {}", count(names.len(), "material"), some(names)));
            }
        };
        let sharp = with(&|m| m.exponent > highest);
        tell(&sharp, format!("with a Phong exponent above {highest} shaded as diffuse"));
        let bright =
            with(&|m| m.lobe(highest).is_some() && (m.specular + m.albedo).max_element() > 1.0 + MARGIN);
        tell(&bright, "with Kd + Ks above 1, where Ks was cut to 1 - Kd".into());
        report
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(albedo: f32, specular: f32, exponent: f32) -> Material {
        Material {
            name: format!("{exponent}"),
            albedo: Vec3::splat(albedo),
            specular: Vec3::splat(specular),
            exponent,
            ..Material::default()
        }
    }

    #[test]
    fn lobe_keeps_energy_and_stops_at_the_highest_exponent() {
        assert_eq!(material(0.5, 0.0, 10.0).lobe(50.0), None);
        assert_eq!(material(0.5, 0.3, 51.0).lobe(50.0), None);
        let lobe = material(0.5, 0.3, 50.0).lobe(50.0);
        assert_eq!(lobe, Some(Lobe { specular: Vec3::splat(0.3), exponent: 50.0 }));
        assert_eq!(material(0.75, 0.9, 5.0).lobe(50.0).map(|l| l.specular), Some(Vec3::splat(0.25)));
        assert_eq!(material(1.0, 0.9, 5.0).lobe(50.0), None, "nothing is left for the lobe");
    }

    #[test]
    fn report_names_materials_in_use_alone() {
        let mut scene = crate::builtin::build("plane:n=1").unwrap();
        scene.materials =
            vec![material(0.5, 0.3, 300.0), material(0.9, 0.4, 12.0), material(0.1, 0.2, 999.0)];
        scene.mesh.material = vec![0, 1];
        let report = scene.gloss_report(50.0);
        assert_eq!(report.len(), 2, "{report:?}");
        assert!(report[0].contains("above 50") && report[0].ends_with(": 300"), "{}", report[0]);
        assert!(report[1].contains("Kd + Ks") && report[1].ends_with(": 12"), "{}", report[1]);
        let lobes = scene.vertex_lobes(50.0);
        assert!(lobes.iter().any(|l| l.exponent == 12.0) && lobes.contains(&Lobe::default()));
    }
}
