//! Imports run one way: no file is reached again by following the imports that leave it.
//!
//! An arrow goes from a file to the file of each module that it names by `crate::` or `super::`. What a
//! module takes from its own ancestors, in whose files traits and types of the whole folder stand, is no
//! arrow. Unit tests are left out.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The modules of a crate: path within it, and text.
type Modules = BTreeMap<Vec<String>, String>;

fn modules(source: &Path) -> Modules {
    fn read(folder: &Path, path: &[String], found: &mut Modules) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let file = entry.unwrap().path();
            let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
            let mut module = path.to_vec();
            if file.is_dir() {
                module.push(name);
                read(&file, &module, found);
            } else if file.extension().is_some_and(|e| e == "rs") && !name.starts_with("tests") {
                if !matches!(name.as_str(), "mod" | "lib" | "main") {
                    module.push(name);
                }
                found.insert(module, code(&std::fs::read_to_string(&file).unwrap()));
            }
        }
    }
    let mut found = Modules::new();
    read(source, &[], &mut found);
    found
}

/// Without comments and unit tests.
fn code(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let lines = text[..end].lines();
    let kept = lines.filter(|line| !line.trim_start().starts_with("//"));
    kept.collect::<Vec<_>>().join("\n")
}

/// The paths that a text names, each from the crate's root.
fn named(module: &[String], text: &str) -> BTreeSet<Vec<String>> {
    let mut found = BTreeSet::new();
    for (start, root) in ["crate::", "super::"]
        .iter()
        .flat_map(|root| text.match_indices(root))
    {
        let before = text[..start].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':' || c == '$') {
            continue;
        }
        let base = match root {
            "crate::" => Vec::new(),
            _ => module[..module.len().saturating_sub(1)].to_vec(),
        };
        expand(base, &text[start + root.len()..], &mut found);
    }
    found
}

/// Follows a path, and each branch of a group in braces; returns what it has read.
fn expand(mut path: Vec<String>, text: &str, found: &mut BTreeSet<Vec<String>>) -> usize {
    let mut at = 0;
    loop {
        let rest = &text[at..];
        if let Some(group) = rest.strip_prefix('{') {
            let mut inside = 0;
            while !group[inside..].starts_with('}') && inside < group.len() {
                let skipped = group[inside..].len()
                    - group[inside..].trim_start_matches([' ', '\n', ',']).len();
                inside += skipped;
                if group[inside..].starts_with('}') {
                    break;
                }
                inside += expand(path.clone(), &group[inside..], found).max(1);
            }
            return at + 1 + inside + 1;
        }
        let word = rest
            .find(|c: char| !(c.is_alphanumeric() || c == '_'))
            .unwrap_or(rest.len());
        match &rest[..word] {
            "super" => {
                path.pop();
            }
            "self" => {}
            name => path.push(name.to_owned()),
        }
        at += word;
        if word == 0 || !text[at..].starts_with("::") {
            found.insert(path);
            return at;
        }
        at += 2;
    }
}

/// For each module those that it imports.
fn arrows(modules: &Modules) -> BTreeMap<&[String], BTreeSet<&[String]>> {
    let file_of = |path: &[String]| {
        (0..=path.len())
            .rev()
            .find_map(|length| modules.get_key_value(&path[..length]))
            .map(|(module, _)| module.as_slice())
    };
    let all = modules.iter().map(|(module, text)| {
        let named = named(module, text);
        let targets = named.iter().filter_map(|path| file_of(path));
        let mut others: BTreeSet<&[String]> = targets
            .filter(|target| !module.starts_with(target))
            .collect();
        // What it takes from its own folder, to hand on to others.
        let children = text.lines().filter_map(|line| {
            let (_, path) = line.split_once("use ")?;
            let name = path.split("::").next()?.to_owned();
            file_of(&[module.as_slice(), &[name]].concat())
        });
        others.extend(children.filter(|child| child.len() > module.len()));
        (module.as_slice(), others)
    });
    all.collect()
}

/// A way from a module back to itself.
fn circle<'a>(
    arrows: &BTreeMap<&'a [String], BTreeSet<&'a [String]>>,
) -> Option<Vec<&'a [String]>> {
    for &start in arrows.keys() {
        let mut ways = vec![vec![start]];
        let mut seen = BTreeSet::new();
        while let Some(way) = ways.pop() {
            for &next in way
                .last()
                .and_then(|last| arrows.get(last))
                .into_iter()
                .flatten()
            {
                if next == start {
                    return Some(way);
                }
                if seen.insert(next) {
                    ways.push([way.as_slice(), &[next]].concat());
                }
            }
        }
    }
    None
}

#[test]
fn no_import_leads_back_to_where_it_came_from() {
    let root: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for package in [
        "elm",
        "elm-datasets",
        "elm-brdf/render",
        "elm-brdf",
        "benches",
    ] {
        let modules = modules(&root.join(package).join("src"));
        assert!(modules.len() > 5, "{package}: {} files", modules.len());
        if let Some(way) = circle(&arrows(&modules)) {
            let way: Vec<String> = way.iter().map(|module| module.join("::")).collect();
            panic!("{package}: a circle of imports: {}", way.join(" -> "));
        }
    }
}

#[test]
fn packages_depend_on_none_above_them() {
    let root: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let own = ["elm-learn", "elm-datasets", "elm-brdf-render", "elm-brdf"];
    for (package, expected) in [
        ("elm", &[][..]),
        ("elm-datasets", &[]),
        ("elm-brdf/render", &["elm-datasets"]),
        (
            "elm-brdf",
            &["elm-brdf-render", "elm-datasets", "elm-learn"],
        ),
    ] {
        let manifest = std::fs::read_to_string(root.join(package).join("Cargo.toml")).unwrap();
        let (_, rest) = manifest.split_once("\n[dependencies]\n").unwrap();
        let table = rest.split("\n[").next().unwrap();
        let names = table
            .lines()
            .filter_map(|line| line.split(['.', ' ']).next());
        let found: Vec<&str> = names.filter(|name| own.contains(name)).collect();
        assert_eq!(found, expected, "{package}");
    }
}

#[test]
fn a_circle_is_found_through_groups_and_inline_paths() {
    let module = |name: &str, text: &str| (vec![name.to_owned()], code(text));
    let circular = Modules::from([
        module(
            "a",
            "use crate::{\n    c::Third,\n    b::{First, Second},\n};",
        ),
        module("b", "// crate::a\nfn f() { crate::c::g() }"),
        module("c", "use super::a::Fourth;"),
    ]);
    assert_eq!(circle(&arrows(&circular)).unwrap().len(), 2);
    let straight = Modules::from([
        module("a", "use crate::b::{First, Second};"),
        module(
            "b",
            "fn f() {}\n#[cfg(test)]\nmod tests {\n    use crate::a::Fourth;\n}",
        ),
    ]);
    assert!(circle(&arrows(&straight)).is_none());
}
