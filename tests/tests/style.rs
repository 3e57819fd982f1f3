//! Rules for text that no compiler checks: the length of comments, and files that are named.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The project's files with one of these extensions, without what builds and tools leave behind.
fn files(extensions: &[&str]) -> Vec<PathBuf> {
    fn walk(dir: &Path, extensions: &[&str], found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let built = matches!(name.as_str(), "target" | "corpus" | "found" | "artifacts");
            if path.is_dir() {
                if !built && !name.starts_with('.') {
                    walk(&path, extensions, found);
                }
            } else if extensions
                .iter()
                .any(|e| path.extension().is_some_and(|x| x == *e))
            {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(&root(), extensions, &mut found);
    found
}

#[test]
fn no_comment_passes_110_columns() {
    let mut long = Vec::new();
    for path in files(&["rs"]) {
        for (index, line) in fs::read_to_string(&path).unwrap().lines().enumerate() {
            let text = line.trim_start();
            // Neither a row of a table nor an address can be broken.
            let whole = text.contains(" | ") || text.contains("://");
            if text.starts_with("//") && !whole && line.chars().count() > 110 {
                long.push(format!("{}:{}", path.display(), index + 1));
            }
        }
    }
    assert!(long.is_empty(), "{long:#?}");
}

#[test]
fn links_of_the_documentation_lead_to_files() {
    let mut broken = Vec::new();
    for path in files(&["md"]) {
        let text = fs::read_to_string(&path).unwrap();
        let links = text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next());
        for link in links.filter(|link| !link.contains("://") && !link.starts_with('#')) {
            let (file, _) = link.split_once('#').unwrap_or((link, ""));
            if !path.parent().unwrap().join(file).exists() {
                broken.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn files_of_the_documentation_that_sources_name_exist() {
    let mut missing = Vec::new();
    for path in files(&["rs", "toml", "md", "py"]) {
        let text = fs::read_to_string(&path).unwrap();
        for (at, _) in text.match_indices("docs/") {
            let allowed = |c: char| c.is_ascii_alphanumeric() || "/-_.".contains(c);
            let name = text[at..].split(|c| !allowed(c)).next().unwrap_or_default();
            let name = name.trim_end_matches('.');
            let before = text[..at].chars().next_back();
            let begins = before.is_none_or(|c| !allowed(c));
            if begins && !root().join(name).exists() {
                missing.push(format!("{}: {name}", path.display()));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
}
