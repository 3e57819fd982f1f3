//! Refuses to write over a file that the same command reads.

use std::path::{Path, PathBuf};

use super::Failure;
use crate::scene_materials::Scene;

/// Refuses outputs that are inputs, by whatever names or links.
pub(super) fn refuse<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: &[PathBuf],
) -> Result<(), Failure> {
    let mut written: Vec<&Path> = Vec::new();
    for output in outputs {
        if let Some(input) = inputs.iter().find(|input| is_same(input, output)) {
            return Err(Failure::Usage(format!(
                "{} is an input ({}) and would be overwritten: name another output",
                output.display(),
                input.display()
            )));
        }
        if written
            .iter()
            .any(|other| *other == output || is_same(other, output))
        {
            return Err(Failure::Usage(format!(
                "{} is named for two outputs: expected different files",
                output.display()
            )));
        }
        written.push(output);
    }
    Ok(())
}

/// Refuses a folder for results of these names, if one of them is an input there.
pub(super) fn refuse_folder<S: AsRef<str>>(
    folder: &Path,
    names: &[S],
    inputs: &[PathBuf],
) -> Result<(), Failure> {
    let files: Vec<PathBuf> = names
        .iter()
        .map(|name| folder.join(name.as_ref()))
        .collect();
    refuse(files.iter().map(PathBuf::as_path), inputs)
}

/// Names of results in all these forms.
pub(super) fn names(stems: &[&str], extensions: &[&str]) -> Vec<String> {
    let all = stems
        .iter()
        .flat_map(|stem| extensions.iter().map(move |e| format!("{stem}.{e}")));
    all.collect()
}

/// The files in a folder of measurements.
pub(super) fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| entry.path())
        .filter(|path| path.is_file())
        .collect()
}

/// The files that a scene reads, itself included.
pub(super) fn of_scene(path: &Path, scene: &Scene) -> Vec<PathBuf> {
    let mut inputs = vec![path.to_owned()];
    let folder = path.parent().unwrap_or(Path::new(""));
    for material in scene.material.values() {
        inputs.extend(material.get_ref().files().map(|file| folder.join(file)));
    }
    for mesh in &scene.mesh {
        inputs.extend(mesh.get_ref().file.iter().map(|file| folder.join(file)));
    }
    if let Some(environment) = &scene.environment {
        inputs.extend(
            environment
                .get_ref()
                .file
                .iter()
                .map(|file| folder.join(file)),
        );
    }
    inputs
}

/// Whether two paths lead to one file that is there.
fn is_same(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        if let (Ok(a), Ok(b)) = (a.metadata(), b.metadata()) {
            return a.dev() == b.dev() && a.ino() == b.ino();
        }
    }
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}
