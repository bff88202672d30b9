//! Portals out of a scene's own triangles, by the name of their material or group.

use std::collections::BTreeMap;

use glam::Vec3;
use glob::Pattern;

use super::Portal;
use crate::names::count;
use crate::scene::{Error, Mesh, Scene};

/// Most names that the error about a name that matches nothing lists of a kind.
const MOST_LISTED: usize = 24;

/// Takes the triangles whose material or group matches one of the patterns (`*`, `?`, `[a-z]`; case matters) out of
/// the mesh, which keeps its order and loses the vertices that nothing uses any more. Triangles of one material
/// become one portal of its name and transmission, in the order of the scene's materials. Which side is inside is
/// what their winding says, until rays tell. What was mended is added to the scene's report.
///
/// # Errors
/// [`Error::Invalid`] if a pattern is none, matches nothing (it lists what there is), or matches only triangles
/// without area, or if no triangle would be left to light. The scene is not changed then.
pub fn take_portals(scene: &mut Scene, globs: &[String]) -> Result<Vec<Portal>, Error> {
    let taken = matched(scene, globs)?;
    if taken.iter().all(|&t| t) {
        return Err(invalid(globs, "every triangle would be a portal, and none is left to be lit"));
    }
    let mut of_material: BTreeMap<u32, Vec<[Vec3; 3]>> = BTreeMap::new();
    for (i, _) in taken.iter().enumerate().filter(|(_, t)| **t) {
        let corners = scene.mesh.index[i].map(|v| scene.mesh.position[v as usize]);
        of_material.entry(scene.mesh.material[i]).or_default().push(corners);
    }
    let mut report = Vec::new();
    let mut portals = Vec::new();
    for (material, triangles) in of_material {
        portals.extend(portal(scene, material, triangles, &mut report));
    }
    if portals.is_empty() {
        return Err(invalid(globs, "no triangle of it has an area"));
    }
    let kept: Vec<bool> = taken.iter().map(|t| !t).collect();
    scene.mesh = compacted(&scene.mesh, &kept);
    scene.report.extend(report);
    Ok(portals)
}

fn portal(
    scene: &Scene,
    material: u32,
    triangles: Vec<[Vec3; 3]>,
    report: &mut Vec<String>,
) -> Option<Portal> {
    let material = &scene.materials[material as usize];
    let opaque = material.transmission == Vec3::ZERO;
    let transmission = if opaque { Vec3::ONE } else { material.transmission };
    let n = triangles.len();
    let portal = Portal::new(&material.name, triangles, transmission);
    let n_flat = n - portal.as_ref().map_or(0, |p| p.triangles.len());
    if n_flat > 0 {
        let what = count(n_flat, "triangle");
        report.push(format!("portal '{}': {what} without area left out", material.name));
    }
    if opaque && portal.is_some() {
        report.push(format!("portal '{}': its material is opaque and was taken as clear", material.name));
    }
    portal
}

/// Whether each triangle matches a pattern.
fn matched(scene: &Scene, globs: &[String]) -> Result<Vec<bool>, Error> {
    let mesh = &scene.mesh;
    let mut taken = vec![false; mesh.index.len()];
    for glob in globs {
        let pattern = Pattern::new(glob).map_err(|e| invalid(std::slice::from_ref(glob), e.msg))?;
        let materials: Vec<bool> = scene.materials.iter().map(|m| pattern.matches(&m.name)).collect();
        let groups: Vec<bool> = scene.groups.iter().map(|g| pattern.matches(g)).collect();
        let mut any = false;
        for (i, taken) in taken.iter_mut().enumerate() {
            if materials[mesh.material[i] as usize] || groups[mesh.group[i] as usize] {
                (*taken, any) = (true, true);
            }
        }
        if !any {
            return Err(invalid(
                std::slice::from_ref(glob),
                &format!("matches nothing; {}", there_is(scene)),
            ));
        }
    }
    Ok(taken)
}

/// Names in use, see-through materials first.
fn there_is(scene: &Scene) -> String {
    let used = |of: &[u32], n: usize| {
        let mut used = vec![false; n];
        of.iter().for_each(|&i| used[i as usize] = true);
        used
    };
    let materials = used(&scene.mesh.material, scene.materials.len());
    let mut materials: Vec<_> = scene.materials.iter().zip(materials).filter(|(_, used)| *used).collect();
    materials.sort_by_key(|(m, _)| m.transmission == Vec3::ZERO);
    let materials: Vec<&str> = materials.iter().map(|(m, _)| m.name.as_str()).collect();
    let groups = used(&scene.mesh.group, scene.groups.len());
    let groups: Vec<&str> =
        scene.groups.iter().zip(groups).filter(|(_, used)| *used).map(|(g, _)| g.as_str()).collect();
    format!("there are the materials {} and the groups {}", listed(&materials), listed(&groups))
}

fn listed(names: &[&str]) -> String {
    let shown = names[..names.len().min(MOST_LISTED)].join(", ");
    if names.len() > MOST_LISTED { format!("{shown} and {} more", names.len() - MOST_LISTED) } else { shown }
}

fn invalid(globs: &[String], what: &str) -> Error {
    Error::Invalid { at: format!("portal '{}'", globs.join("', '")), what: what.to_owned() }
}

/// The mesh without the triangles that are not kept and the vertices that only they used.
pub(super) fn compacted(mesh: &Mesh, kept: &[bool]) -> Mesh {
    let mut used = vec![false; mesh.position.len()];
    let triangles = || mesh.index.iter().zip(kept).filter(|(_, kept)| **kept).map(|(t, _)| *t);
    triangles().flatten().for_each(|v| used[v as usize] = true);
    let mut n = 0;
    let new: Vec<u32> = used
        .iter()
        .map(|&is_used| {
            n += u32::from(is_used);
            n.saturating_sub(1)
        })
        .collect();
    Mesh {
        position: only(&mesh.position, &used),
        normal: only(&mesh.normal, &used),
        index: triangles().map(|t| t.map(|v| new[v as usize])).collect(),
        material: only(&mesh.material, kept),
        group: only(&mesh.group, kept),
    }
}

fn only<T: Copy>(list: &[T], which: &[bool]) -> Vec<T> {
    list.iter().zip(which).filter(|(_, which)| **which).map(|(item, _)| *item).collect()
}
