//! Data goes one way: no module of a crate imports, by however many others, one that imports it. What tests import does not count.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// By its path from the crate's root: [] is lib.rs, ["dynamics", "law"] is dynamics/law.rs.
type Module = Vec<String>;

/// The code of each module.
type Sources = BTreeMap<Module, String>;

/// Whom each module imports.
type Imports = BTreeMap<Module, Vec<Module>>;

#[test]
fn no_module_imports_one_that_imports_it() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("crates stand side by side");
    let mut n_crates = 0;
    for entry in fs::read_dir(crates).expect("the crates can be listed") {
        let source = entry.expect("the crates can be listed").path().join("src");
        if !source.is_dir() {
            continue;
        }
        let mut sources = Sources::new();
        read(&source, &[], &mut sources);
        let imports = imports(&sources);
        assert!(sources.len() > 5 && imports[&Module::new()].len() > 2, "hardly anything read of {source:?}");
        if let Some(circle) = circle(&imports) {
            let names: Vec<String> = circle.iter().map(name).collect();
            panic!("a circle of imports in {source:?}: {}", names.join(" -> "));
        }
        n_crates += 1;
    }
    assert!(n_crates >= 5, "only {n_crates} crates were found");
}

#[test]
fn a_circle_is_found_whichever_way_its_imports_are_written() {
    let straight = [("", "pub use a::A;"), ("a", "use crate::b::B;"), ("b", "use std::fmt;"), ("b::c", "struct C;")];
    let found = |modules: &[(&str, &str)]| {
        let module = |path: &str| path.split("::").filter(|s| !s.is_empty()).map(str::to_owned).collect();
        circle(&imports(&modules.iter().map(|(path, text)| (module(path), code(text))).collect()))
    };
    assert_eq!(found(&straight), None);
    for (path, text) in [
        ("b", "use crate::a::A;"),
        ("b", "pub(crate) use super::a;"),
        ("b", "use crate::{\n    a::{self, A},\n    d,\n};"),
        ("b", "use crate::A;"),
        ("b", "fn f() { crate::a::g(1) }"),
        ("b", "fn f() -> super::A { panic!() }"),
        ("b", "use std::{fmt, io}; // both\nuse crate::a::*;"),
        ("b", "use c::C;\nuse crate::a::A as B;"),
        ("b::c", "use super::B;\nuse crate::A;"),
    ] {
        let mut modules = straight.to_vec();
        modules.extend((path == "b::c").then_some(("b", "fn f() { c::C }")));
        modules.push((path, text));
        assert!(found(&modules).is_some(), "{path}: {text}");
    }
    for text in [
        "/// Of [`crate::a::A`].\nstruct B;",
        "#[cfg(test)]\nmod tests {\n    use crate::a::A;\n}",
        "struct B; // crate::a::A",
        "use self::c::C;\nfn f() { a::A }",
    ] {
        let mut modules = straight.to_vec();
        modules.push(("b", text));
        assert_eq!(found(&modules), None, "{text}");
    }
}

/// The modules under a folder.
fn read(folder: &Path, module: &[String], sources: &mut Sources) {
    for entry in fs::read_dir(folder).expect("the sources can be listed") {
        let path = entry.expect("the sources can be listed").path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).expect("names are text").to_owned();
        let inner = [module, std::slice::from_ref(&stem)].concat();
        if path.is_dir() {
            read(&path, &inner, sources);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).expect("sources can be read");
            let module = if stem == "lib" || stem == "mod" { module.to_vec() } else { inner };
            sources.insert(module, code(&text));
        }
    }
}

/// A source without comments and without what is compiled for tests only.
fn code(text: &str) -> String {
    let mut kept = String::new();
    let mut lines = text.lines().map(|line| {
        let comment = line.match_indices("//").find(|(at, _)| line[..*at].matches('"').count() % 2 == 0);
        comment.map_or(line, |(at, _)| &line[..at]).trim_end()
    });
    while let Some(line) = lines.next() {
        let Some(indent) = line.strip_suffix("#[cfg(test)]") else {
            kept.extend([line, "\n"]);
            continue;
        };
        let end = format!("{indent}}}");
        let item = lines.by_ref().find(|line| !line.trim_start().starts_with("#["));
        if item.is_some_and(|line| !line.ends_with([';', '}'])) {
            lines.by_ref().find(|line| *line == end);
        }
    }
    kept
}

/// Whom the modules import, each once.
fn imports(sources: &Sources) -> Imports {
    let of = |(module, code): (&Module, &String)| {
        let mut imported: Vec<Module> = paths(code)
            .iter()
            .filter_map(|path| named(sources, module, path))
            .filter(|other| other != module)
            .collect();
        imported.sort();
        imported.dedup();
        (module.clone(), imported)
    };
    sources.iter().map(of).collect()
}

/// Every path of the code, those of `use` trees one by one.
fn paths(code: &str) -> Vec<Vec<&str>> {
    let mut paths = Vec::new();
    let mut rest = code;
    // Not the word in a message.
    let starts = |line: &str| line.trim().is_empty() || line.trim_start().starts_with("pub");
    while let Some(at) = rest.find(|c: char| c.is_alphabetic() || c == '_') {
        let line = code[..code.len() - rest.len() + at].rsplit('\n').next().unwrap_or_default();
        rest = &rest[at..];
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).unwrap_or(rest.len());
        let (word, after) = rest.split_at(end);
        rest = after;
        if word == "use" && after.starts_with(' ') && starts(line) {
            let end = after.find(';').unwrap_or(after.len());
            expand(&after[..end], &[], &mut paths);
            rest = &after[end..];
        } else if word.contains("::") && !after.starts_with('!') {
            // A macro's place is the crate's root, whichever module it is of.
            paths.push(word.split("::").collect());
        }
    }
    paths
}

/// `a::{b, c::{d, e}}` to a::b, a::c::d, a::c::e.
fn expand<'a>(tree: &'a str, before: &[&'a str], paths: &mut Vec<Vec<&'a str>>) {
    let (path, inner) = match tree.split_once('{') {
        Some((path, inner)) => (path, inner.rsplit_once('}').map(|(inner, _)| inner)),
        None => (tree, None),
    };
    let path = path.split(" as ").next().unwrap_or_default();
    let segments = path.split("::").map(str::trim).filter(|segment| !segment.is_empty());
    let whole: Vec<&str> = before.iter().copied().chain(segments).collect();
    let Some(inner) = inner else {
        paths.extend((whole.len() > before.len()).then_some(whole));
        return;
    };
    let (mut depth, mut start) = (0, 0);
    for (at, c) in inner.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                expand(&inner[start..at], &whole, paths);
                start = at + 1;
            }
            _ => {}
        }
    }
    expand(&inner[start..], &whole, paths);
}

/// The module of this crate that a path in `module` names, or that the named item stands in.
fn named(sources: &Sources, module: &Module, path: &[&str]) -> Option<Module> {
    let mut found = module.clone();
    let mut path = path.iter().peekable();
    match **path.peek()? {
        "crate" => found.clear(),
        "self" | "super" => {}
        // A module within this one, or else a name that is another crate's or has been imported.
        child => {
            return sources
                .contains_key(&[module.as_slice(), &[child.to_owned()]].concat())
                .then(|| within(sources, found, path));
        }
    }
    if found.is_empty() || **path.peek()? == "self" {
        path.next();
    }
    while path.peek().is_some_and(|segment| **segment == "super") {
        found.pop();
        path.next();
    }
    Some(within(sources, found, path))
}

/// As far along a path as there are modules.
fn within<'a>(sources: &Sources, mut found: Module, path: impl Iterator<Item = &'a &'a str>) -> Module {
    for segment in path {
        found.push((*segment).to_owned());
        if !sources.contains_key(&found) {
            found.pop();
            break;
        }
    }
    found
}

/// Modules of which each imports the next, the last the first.
fn circle(imports: &Imports) -> Option<Vec<Module>> {
    // A module that imports none is in no circle, nor is one that imports such alone.
    let mut left = imports.clone();
    loop {
        let before = left.len();
        let still: Vec<Module> = left.keys().cloned().collect();
        left.retain(|_, imported| imported.iter().any(|module| still.contains(module)));
        if left.len() == before {
            break;
        }
    }
    let mut way = vec![left.keys().next()?.clone()];
    loop {
        let next = left[&way[way.len() - 1]].iter().find(|module| left.contains_key(*module))?.clone();
        if let Some(at) = way.iter().position(|module| *module == next) {
            return Some(way.split_off(at));
        }
        way.push(next);
    }
}

fn name(module: &Module) -> String {
    if module.is_empty() { "lib".to_owned() } else { module.join("::") }
}
