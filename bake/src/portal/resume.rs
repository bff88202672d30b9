//! What an earlier bake has already.

use lunette_relight::asset::Asset;

use crate::{Error, Options};

/// Options that must be the same, as only more bands and more photons continue a bake.
const SAME: [&str; 3] = ["rays", "bounces", "resolution"];

/// Bounced light that is there.
pub struct There {
    /// \[V, 3 n\], red, green, blue.
    pub rows: Vec<f32>,
    /// Coefficients.
    pub n: usize,
    /// Photons behind it; 0 for gathering.
    pub photons: u64,
}

/// Whether the earlier asset is of the same scene and comparable options as the one that is begun.
pub fn check(earlier: &Asset, begun: &Asset) -> Result<(), Error> {
    let (old, new) = (&earlier.metadata, &begun.metadata);
    let fail = |what: String| Err(Error::Option { name: "continue", what });
    if old.scene_hash != new.scene_hash {
        return fail("it was baked from another scene, or with other portals taken out; bake anew".into());
    }
    if old.shells != new.shells {
        let names = |shells: &[lunette_relight::asset::Shell]| {
            shells.iter().skip(1).map(|s| s.name.clone()).collect::<Vec<_>>().join(", ")
        };
        let (old, new) = (names(&old.shells), names(&new.shells));
        return fail(format!(
            "its portals ({old}) are not those of now ({new}) to the last number; bake anew"
        ));
    }
    if old.seed != new.seed {
        return fail(format!("it was baked with --seed {}, not {}", old.seed, new.seed));
    }
    if let Some(name) = SAME.iter().find(|name| old.options.get(**name) != new.options.get(**name)) {
        let value = |options: &std::collections::BTreeMap<_, serde_json::Value>| {
            options.get(*name).map_or("unknown".to_string(), |v| v.to_string())
        };
        let (old, new) = (value(&old.options), value(&new.options));
        return fail(format!("it was baked with --{name} {old}, not {new}"));
    }
    if old.options.contains_key("photons") != new.options.contains_key("photons") {
        return fail(
            "bounced light starts from photons in one of the two bakes, and not in the other".into(),
        );
    }
    if (0..new.shells.len() - 1).any(|k| earlier.tensor(&format!("portal.{k}.direct.start")).is_none()) {
        return fail("it has no direct light of every portal".into());
    }
    Ok(())
}

/// Bounced light of portal `k`, at most `n` coefficients of it; none where none is baked.
pub fn bounced(earlier: &Asset, k: usize, n: usize) -> Option<There> {
    let name = format!("portal.{k}.indirect.sh");
    let (values, scale) = earlier.half(&name)?;
    let stored = earlier.order(&name)?.pow(2);
    let n = n.min(stored);
    let row = |r: &[half::f16]| {
        (0..3)
            .flat_map(|c| (0..n).map(move |i| (c, i)))
            .map(|(c, i)| scale * r[3 * i + c].to_f32())
            .collect::<Vec<_>>()
    };
    let rows = values.chunks_exact(3 * stored).flat_map(row).collect();
    Some(There { rows, n, photons: photons(earlier) })
}

/// Photons that were traced; 0 for gathering.
pub fn photons(earlier: &Asset) -> u64 {
    earlier.metadata.options.get("photons").and_then(|v| v.as_u64()).unwrap_or(0)
}

/// Whether its direct-to-indirect transport is what is asked for.
pub fn has_carrier(earlier: &Asset, options: &Options) -> bool {
    let is = |name: &str, value: usize| earlier.metadata.options.get(name) == Some(&value.into());
    earlier.tensor("indirect.node").is_some() && is("patches", options.patches) && is("links", options.links)
}

/// Copies all tensors under a name.
pub fn copy(earlier: &Asset, prefix: &str, asset: &mut Asset<'static>) {
    let under = |name: &str| name.strip_prefix(prefix).is_some_and(|rest| rest.starts_with('.'));
    for (name, tensor) in earlier.tensors().filter(|(name, _)| under(name)) {
        asset.insert(name, &tensor.shape, tensor.data.clone().into_owned());
        if let Some(scale) = earlier.metadata.scale.get(name) {
            asset.metadata.scale.insert(name.to_string(), *scale);
        }
    }
}
