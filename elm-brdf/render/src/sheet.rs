//! Renders several pictures as panels of one.

use crate::adaptive::{self, Difference};
use crate::error::{Error, Result};
use crate::loader::MaterialLoader;
use crate::scene::Scene;
use crate::stats::RenderStats;
use crate::{Options, Rendering};

/// Pictures of one size in rows and columns, rendered as one picture.
#[derive(Debug, Clone)]
pub struct Sheet<M> {
    /// Pictures in a row.
    pub columns: usize,
    /// Row by row.
    pub panels: Vec<Panel<M>>,
    /// Words at the foot, with `{data}` for where the materials come from, and `{name}` for what
    /// those of the first panel are called.
    pub caption: String,
}

/// One picture of a sheet.
#[derive(Debug, Clone)]
pub struct Panel<M> {
    /// Words at its head, with `{name}` for the name of its only material.
    pub title: String,
    /// What it shows.
    pub content: Content<M>,
}

/// What a panel shows.
#[derive(Debug, Clone)]
pub enum Content<M> {
    /// A scene.
    Scene(Box<Scene<M>>),
    /// How two panels before it differ: `factor` times the absolute difference of radiance.
    Difference {
        /// Index of one panel.
        of: usize,
        /// Index of the other.
        from: usize,
        /// Factor on the difference.
        factor: f64,
    },
}

impl<M> From<Scene<M>> for Sheet<M> {
    /// A sheet with nothing else on it.
    fn from(scene: Scene<M>) -> Self {
        Self {
            columns: 1,
            caption: scene.image.caption.clone(),
            panels: vec![Panel {
                title: String::new(),
                content: Content::Scene(Box::new(scene)),
            }],
        }
    }
}

impl<M> Sheet<M> {
    /// The scenes on it.
    pub fn scenes(&mut self) -> impl Iterator<Item = &mut Scene<M>> {
        self.panels
            .iter_mut()
            .filter_map(|panel| match &mut panel.content {
                Content::Scene(scene) => Some(&mut **scene),
                Content::Difference { .. } => None,
            })
    }

    /// Sets the size of the whole sheet, in pixels, approximately.
    pub fn resize(&mut self, width: u32, height: u32) {
        let columns = self.columns.max(1) as u32;
        let rows = self.panels.len().div_ceil(columns as usize).max(1) as u32;
        for scene in self.scenes() {
            (scene.image.width, scene.image.height) = (width / columns, height / rows);
        }
    }

    /// Renders every panel, as [`render`](super::render) does one scene; all have the size and the
    /// exposure of the first.
    ///
    /// # Errors
    /// As [`render`](super::render); [`Error::Sheet`] for panels of different sizes, and for a difference
    /// from a panel that is no scene before it.
    pub fn render(
        &self,
        loader: &dyn MaterialLoader<M>,
        options: Options,
        progress: &(dyn Fn(u64, u64) + Sync),
    ) -> Result<Rendering>
    where
        M: Sync,
    {
        let groups = self.groups()?;
        let count = groups
            .iter()
            .map(|group| group.scenes.len() as u64)
            .sum::<u64>();
        let mut done: Vec<Option<Rendering>> = vec![None; self.panels.len()];
        let mut before = 0;
        for Group {
            scenes,
            differences,
        } in groups
        {
            let here = scenes.len() as u64;
            let (places, scenes): (Vec<usize>, Vec<&Scene<M>>) = scenes.into_iter().unzip();
            let renderings =
                adaptive::render(&scenes, &differences, loader, options, &|part, whole| {
                    // Panels of one size take about as long as each other.
                    let each = whole / here;
                    progress(before * each + part, count * each);
                })?;
            for (place, rendering) in places.into_iter().zip(renderings) {
                done[place] = Some(rendering);
            }
            before += here;
        }
        for (index, panel) in self.panels.iter().enumerate() {
            if let Content::Difference { of, from, factor } = panel.content {
                // Groups were made of what there is.
                let panels = (done.get(of), done.get(from));
                let (Some(Some(a)), Some(Some(b))) = panels else {
                    return Err(Error::Sheet { panel: index });
                };
                done[index] = Some(difference(a, b, factor));
            }
        }
        let done: Vec<Rendering> = done.into_iter().flatten().collect();
        self.compose(&done)
    }

    /// The scenes by panel, those together whose differences are shown.
    fn groups(&self) -> Result<Vec<Group<'_, M>>> {
        let mut groups: Vec<Group<'_, M>> = Vec::new();
        for (index, panel) in self.panels.iter().enumerate() {
            match &panel.content {
                Content::Scene(scene) => groups.push(Group {
                    scenes: vec![(index, scene)],
                    differences: Vec::new(),
                }),
                Content::Difference { of, from, factor } => {
                    let group = |panel: &usize| {
                        let holds =
                            |group: &Group<'_, M>| group.scenes.iter().any(|s| s.0 == *panel);
                        let sheet = Error::Sheet { panel: index };
                        groups.iter().position(holds).ok_or(sheet)
                    };
                    let (a, b) = (group(of)?, group(from)?);
                    if a != b {
                        let other = groups.remove(a.max(b));
                        groups[a.min(b)].append(other);
                    }
                    let group = &mut groups[a.min(b)];
                    let place = |panel: &usize| group.scenes.iter().position(|s| s.0 == *panel);
                    // Both are in it now.
                    if let (Some(of), Some(from)) = (place(of), place(from)) {
                        let factor = *factor;
                        group.differences.push(Difference { of, from, factor });
                    }
                }
            }
        }
        Ok(groups)
    }

    fn compose(&self, panels: &[Rendering]) -> Result<Rendering> {
        if let ([only], [Panel { title, .. }]) = (panels, &*self.panels)
            && title.is_empty()
        {
            return Ok(only.clone());
        }
        let Some(first) = panels.first() else {
            return Err(Error::Sheet { panel: 0 });
        };
        let (width, height) = (first.width as usize, first.height as usize);
        let columns = self.columns.clamp(1, panels.len());
        let rows = panels.len().div_ceil(columns);
        let mut pixels = vec![[0.0; 3]; columns * width * rows * height];
        let mut labels = Vec::new();
        let mut account = RenderStats::default();
        let mut origins: Vec<String> = Vec::new();
        for (index, (panel, rendering)) in self.panels.iter().zip(panels).enumerate() {
            if (rendering.width, rendering.height) != (first.width, first.height) {
                return Err(Error::Sheet { panel: index });
            }
            let (left, top) = (index % columns * width, index / columns * height);
            for (row, line) in rendering.pixels.chunks_exact(width).enumerate() {
                let start = (top + row) * columns * width + left;
                pixels[start..start + width].copy_from_slice(line);
            }
            let (x, y) = (left as f64, top as f64);
            labels.extend(
                rendering
                    .labels
                    .iter()
                    .map(|(l, [u, v])| (l.clone(), [x + u, y + v])),
            );
            if !panel.title.is_empty() {
                let title = panel.title.replace("{name}", &rendering.names.join(", "));
                labels.push((title, [x + width as f64 / 2.0, y + 2.0]));
            }
            account.merge(&rendering.account, index);
            for origin in &rendering.origins {
                if !origins.contains(origin) {
                    origins.push(origin.clone());
                }
            }
        }
        Ok(Rendering {
            width: (columns * width) as u32,
            height: (rows * height) as u32,
            pixels,
            labels,
            caption: self
                .caption
                .replace("{data}", &origins.join("; "))
                .replace("{name}", &first.names.join(", ")),
            gain: first.gain,
            names: Vec::new(),
            origins,
            account,
        })
    }
}

/// Scenes that are rendered together, with the panels that they fill.
struct Group<'a, M> {
    scenes: Vec<(usize, &'a Scene<M>)>,
    differences: Vec<Difference>,
}

impl<M> Group<'_, M> {
    fn append(&mut self, other: Self) {
        let first = self.scenes.len();
        self.scenes.extend(other.scenes);
        let moved = other.differences.into_iter().map(|difference| Difference {
            of: first + difference.of,
            from: first + difference.from,
            ..difference
        });
        self.differences.extend(moved);
    }
}

fn difference(a: &Rendering, b: &Rendering, factor: f64) -> Rendering {
    let pixels = a.pixels.iter().zip(&b.pixels);
    Rendering {
        pixels: pixels
            .map(|(p, q)| [0, 1, 2].map(|c| factor * (p[c] - q[c]).abs()))
            .collect(),
        labels: Vec::new(),
        caption: String::new(),
        names: Vec::new(),
        origins: Vec::new(),
        account: RenderStats::default(),
        ..*a
    }
}
