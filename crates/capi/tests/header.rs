//! The committed header is what the sources say.

use std::path::Path;

use cbindgen::{Braces, Builder, Config, DocumentationStyle, ExportConfig, Language, SortKey, Style};

const PREAMBLE: &str = "\
/* rthstrack: did the actuator do what the simulation asked? The on-line monitor for real-time programs.
 *
 *     rthstrack_monitor_config config;
 *     rthstrack_monitor *monitor;
 *     char message[256];
 *     rthstrack_monitor_config_default(&config, sizeof config, RTHSTRACK_ABI_VERSION);
 *     if (rthstrack_monitor_create(&config, &monitor, message, sizeof message) != RTHSTRACK_OK) { puts(message); ... }
 *     ... once a sample:
 *     rthstrack_monitor_step(monitor, target, measured, readings, capacity, &n_readings);
 *     ... at the end:
 *     rthstrack_monitor_destroy(monitor);
 *
 * Only _create and _destroy use the heap. All other functions are real-time safe: no heap, no lock, no wait, no
 * log, no system call, bounded work. No function lets a panic or an exception out. Pointers must be null (and are
 * then refused), or point to memory of the stated type and length that nothing else changes during the call; what
 * is written to may not overlap what is read. A pointer to a monitor or an actuator comes from _create and has not
 * been through _destroy. Each such object may be used by one thread at a time, not always the same; functions
 * without one may be called from any.
 *
 * Numbers of statuses, reasons and choices never change their meaning. Whatever else a program can see of a
 * structure or a function changes only together with RTHSTRACK_ABI_VERSION.
 *
 * Made by cbindgen from the sources of crates/capi. Do not edit, but:
 * RTHSTRACK_BLESS=1 cargo test -p rthstrack-capi --test header */";

fn generated() -> String {
    let choices = ["rthstrack_reason", "rthstrack_window", "rthstrack_detrend", "rthstrack_estimator"];
    let config = Config {
        language: Language::C,
        cpp_compat: true,
        style: Style::Both,
        braces: Braces::SameLine,
        header: Some(PREAMBLE.to_owned()),
        include_guard: Some("RTHSTRACK_H".to_owned()),
        no_includes: true,
        sys_includes: vec!["stddef.h".to_owned(), "stdint.h".to_owned()],
        usize_is_size_t: true,
        line_length: 120,
        tab_width: 4,
        documentation_style: DocumentationStyle::C99,
        sort_by: SortKey::None,
        export: ExportConfig { include: choices.map(str::to_owned).to_vec(), ..Default::default() },
        ..Default::default()
    };
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join("lib.rs");
    let mut header = Vec::new();
    Builder::new().with_config(config).with_src(source).generate().expect("the sources are read").write(&mut header);
    String::from_utf8(header).expect("the header is text")
}

#[test]
fn the_committed_header_is_what_the_sources_say() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include").join("rthstrack.h");
    let expected = generated();
    if std::env::var_os("RTHSTRACK_BLESS").is_some() {
        std::fs::write(&path, &expected).expect("the header is written");
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
    let place = expected.lines().zip(found.lines()).position(|(a, b)| a != b);
    assert!(
        found == expected,
        "include/rthstrack.h is not what the sources say (first line that differs: {}); write it anew with \
         RTHSTRACK_BLESS=1 cargo test -p rthstrack-capi --test header",
        place.map_or_else(|| "its end".to_owned(), |n| (n + 1).to_string())
    );
}
