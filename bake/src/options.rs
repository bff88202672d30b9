//! What to bake, and with how much work.

use std::collections::BTreeMap;

use lunette_relight::sh::MAX_ORDER;

use crate::Error;

/// What is stored per vertex for the sky.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// Ambient occlusion and bent normal: 8 bytes.
    Bent,
    /// Axis and radius of the visible cap: 8 bytes; shares the bent normal.
    Aperture,
    /// SH transfer: 2 n² bytes for direct light of the sky, 6 m² for bounced light of any shell.
    Sh,
    /// Sparse rows on a cubemap, in pulses or Haar wavelets, for direct light of the sky: shadows of a sun as sharp as a
    /// texel, in some hundred bytes. What portals always have.
    Haar,
    /// Bounced light from direct light, whatever shines.
    DirectToIndirect,
}

impl Basis {
    /// All of them.
    pub const ALL: [Basis; 5] =
        [Basis::Bent, Basis::Aperture, Basis::Sh, Basis::Haar, Basis::DirectToIndirect];

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Basis::Bent => "bent",
            Basis::Aperture => "aperture",
            Basis::Sh => "sh",
            Basis::Haar => "haar",
            Basis::DirectToIndirect => "direct-to-indirect",
        }
    }
}

/// Everything that decides the bytes of a bake, and the number of threads, which does not.
#[derive(Clone, Debug)]
pub struct Options {
    /// What to store. All three cost no more rays than one.
    pub basis: Vec<Basis>,
    /// SH bands of direct light, 1..=10. Bytes and evaluation grow with its square.
    pub order: usize,
    /// SH bands of bounced light, 1..=10, at most `order`.
    pub indirect_order: usize,
    /// Rays per vertex, 16..=65536, rounded up to a multiple of 16. The error of a shadow falls with about the
    /// power -0.75; time grows in proportion. A quarter of them, but at least 128, serve each bounce.
    pub rays: usize,
    /// Texels on a side of a cubemap's face, 8, 16, 32 or 64, of sparse rows.
    pub resolution: usize,
    /// Most patches of direct-to-indirect transport, 16..=32767: detail of bounced light.
    pub patches: usize,
    /// Most links of sixteen neighbouring vertices, in direct-to-indirect transport, to patches and groups of them, 1..=4096:
    /// 1.1 bytes per vertex each.
    pub links: usize,
    /// How often light may bounce, 0..=1000. Each costs about half of the first pass.
    pub bounces: usize,
    /// Seed of every random choice.
    pub seed: u64,
    /// Threads, 0 for all cores.
    pub threads: usize,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            basis: vec![Basis::Bent, Basis::Aperture, Basis::Sh],
            order: 5,
            indirect_order: 5,
            rays: 1024,
            bounces: 2,
            resolution: 32,
            patches: 4096,
            links: 448,
            seed: 1,
            threads: 0,
        }
    }
}

impl Options {
    /// # Errors
    /// When a value is out of the range that its field names.
    pub fn check(&self) -> Result<(), Error> {
        range("order", self.order, 1, MAX_ORDER)?;
        range("indirect-order", self.indirect_order, 1, self.order)?;
        range("patches", self.patches, 16, 32767)?;
        range("links", self.links, 1, 4096)?;
        if !matches!(self.resolution, 8 | 16 | 32 | 64) {
            return Err(Error::Option {
                name: "resolution",
                what: format!("{} is not 8, 16, 32 or 64", self.resolution),
            });
        }
        range("rays", self.rays, 16, 65536)?;
        range("bounces", self.bounces, 0, 1000)?;
        range("threads", self.threads, 0, 1024)?;
        if self.basis.is_empty() {
            return Err(Error::Option {
                name: "basis",
                what: "name at least one of bent, aperture, sh, haar, direct-to-indirect".into(),
            });
        }
        Ok(())
    }

    /// As they go into the file. Threads are left out: they do not change a byte.
    pub(crate) fn describe(&self) -> BTreeMap<String, serde_json::Value> {
        let basis: Vec<&str> = self.basis.iter().map(|b| b.name()).collect();
        BTreeMap::from([
            ("basis".into(), basis.into()),
            ("order".into(), self.order.into()),
            ("indirect_order".into(), self.indirect_order.into()),
            ("rays".into(), self.rays.into()),
            ("bounces".into(), self.bounces.into()),
            ("resolution".into(), self.resolution.into()),
            ("patches".into(), self.patches.into()),
            ("links".into(), self.links.into()),
        ])
    }

    pub(crate) fn has(&self, basis: Basis) -> bool {
        self.basis.contains(&basis)
    }
}

fn range(name: &'static str, value: usize, low: usize, high: usize) -> Result<(), Error> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Error::Option { name, what: format!("{value} is not in {low}..={high}") })
}
