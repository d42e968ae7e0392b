//! C programs against the installed interface: what `install.sh` lays down, found by pkg-config, built by gcc.
#![cfg(unix)]

use std::f64::consts::PI;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use rthstrack::dynamics::{
    Actuator, Compensation, Converter, Delay, Dynamics, Law, Motion, SampledActuator, ServoHydraulic,
};
use rthstrack::{Estimator, Monitor, MonitorConfig, Reading};

const STRICT: [&str; 5] = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"];
const RATE_HZ: f64 = 1024.0;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn scratch() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("capi")
}

/// Runs a command whatever its end.
fn output(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| {
        let name = command.get_program().to_string_lossy().into_owned();
        let cause = if error.kind() == ErrorKind::NotFound { "is not installed".to_owned() } else { error.to_string() };
        panic!("the C interface is tested with {name}, which {cause} (Debian: apt-get install gcc g++ pkg-config)")
    })
}

/// Runs a command that must succeed; what it printed.
fn run(command: &mut Command) -> String {
    let output = output(command);
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}: {}\n{out}{err}", output.status);
    out.into_owned()
}

/// Where everything is installed: the libraries that cargo has built together with this test.
fn prefix() -> &'static Path {
    static PREFIX: OnceLock<PathBuf> = OnceLock::new();
    PREFIX.get_or_init(|| {
        let prefix = scratch().join("prefix");
        let test = std::env::current_exe().expect("a test knows where it is");
        let built = test.parent().expect("a file is in a folder");
        run(Command::new("sh").arg(here("install.sh")).arg(&prefix).arg(built));
        prefix
    })
}

fn pkg_config(arguments: &[&str]) -> Vec<String> {
    let found = prefix().join("lib").join("pkgconfig");
    let printed = run(Command::new("pkg-config").args(arguments).arg("rthstrack").env("PKG_CONFIG_PATH", found));
    printed.split_whitespace().map(str::to_owned).collect()
}

/// Compiles one source and links it with `libraries`; the program.
fn built(source: &str, name: &str, options: &[&str], libraries: &[String]) -> PathBuf {
    let program = scratch().join(name);
    run(Command::new("gcc")
        .args(STRICT)
        .args(["-O2", "-g"])
        .args(options)
        .arg(here(source))
        .arg("-o")
        .arg(&program)
        .args(pkg_config(&["--cflags"]))
        .args(libraries));
    program
}

fn shared_libraries() -> Vec<String> {
    let mut libraries = pkg_config(&["--libs"]);
    libraries.extend(["-lm".to_owned(), format!("-Wl,-rpath,{}", prefix().join("lib").display())]);
    libraries
}

fn static_libraries() -> Vec<String> {
    pkg_config(&["--variable=static_libs"])
}

#[test]
fn the_header_is_strict_c99_and_cpp() {
    let source = scratch().join("header.c");
    fs::create_dir_all(scratch()).unwrap();
    let text = "#include <rthstrack.h>\n#include <rthstrack.h>\n\
                int main(void) { rthstrack_monitor_config c; rthstrack_reading r; \
                rthstrack_status s = rthstrack_monitor_config_default(&c, sizeof c, RTHSTRACK_ABI_VERSION); \
                c.estimator = RTHSTRACK_ESTIMATOR_ALIGNED; r.reason = RTHSTRACK_REASON_STILL; \
                return s == RTHSTRACK_OK && r.reason == 1 ? 0 : 1; }\n";
    fs::write(&source, text).unwrap();
    let include = prefix().join("include");
    let compile = |compiler: &str, language: &str, standard: &str| {
        run(Command::new(compiler)
            .args(["-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-x", language])
            .arg(format!("-std={standard}"))
            .arg("-I")
            .arg(&include)
            .arg(&source));
    };
    for standard in ["c99", "c11", "c17", "c2x"] {
        compile("gcc", "c", standard);
    }
    for standard in ["c++11", "c++20"] {
        compile("g++", "c++", standard);
    }
}

#[test]
fn pkg_config_tells_version_and_flags() {
    assert_eq!(pkg_config(&["--modversion"]), [env!("CARGO_PKG_VERSION")]);
    assert!(pkg_config(&["--libs"]).contains(&"-lrthstrack_c".to_owned()));
    assert!(pkg_config(&["--static", "--libs"]).contains(&"-lc".to_owned()));
}

#[test]
fn a_c_program_finds_everything_as_promised() {
    let program = built("tests/c/test_capi.c", "test_shared", &[], &shared_libraries());
    assert_eq!(run(&mut Command::new(program)), "all as promised\n");
}

/// The linker leads every request for memory through the program's own functions, the Rust library's too.
#[cfg(target_os = "linux")]
#[test]
fn after_create_nothing_uses_the_heap() {
    let wraps =
        ["malloc", "calloc", "realloc", "aligned_alloc", "posix_memalign", "free"].map(|f| format!("-Wl,--wrap={f}"));
    let mut options = vec!["-DCOUNT_HEAP"];
    options.extend(wraps.iter().map(String::as_str));
    let program = built("tests/c/test_capi.c", "test_heap", &options, &static_libraries());
    let printed = run(&mut Command::new(program));
    assert!(printed.ends_with("all as promised\n"), "{printed}");
    assert!(printed.contains("all of them in create"), "{printed}");
}

#[test]
fn memory_is_used_as_it_may_be() {
    if Command::new("valgrind").arg("--version").output().is_ok_and(|o| o.status.success()) {
        let program = built("tests/c/test_capi.c", "test_valgrind", &[], &shared_libraries());
        run(Command::new("valgrind")
            .args(["--quiet", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=all"])
            .arg(program));
    } else {
        println!("no valgrind found: AddressSanitizer instead");
        let options = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
        run(&mut Command::new(built("tests/c/test_capi.c", "test_sanitized", &options, &static_libraries())));
    }
}

/// A and d in ms of a printed line, by the time of its reading.
fn printed_readings(printed: &str) -> Vec<(f64, f64, f64)> {
    let number = |line: &str, before: &str| -> f64 {
        let rest = &line[line.find(before).unwrap() + before.len()..];
        rest.split_whitespace().next().unwrap().parse().unwrap()
    };
    let lines = printed.lines().filter(|line| line.contains(" A "));
    lines.map(|line| (number(line, ""), number(line, " A "), number(line, " d "))).collect()
}

/// What the core itself says of the example's signals.
fn readings_of_the_core(seconds: usize) -> Vec<Reading> {
    let actuator = Actuator {
        dof: 1,
        from_dof: 0,
        specimen: vec![Law::KelvinVoigt { stiffness: 1.19e6, damping: 114.22 }],
        specimen_mass: 29.13,
        part_of_structure: false,
        gain: 1.0,
        delay: Delay::Constant(0.0),
        dynamics: Dynamics::ServoHydraulic(ServoHydraulic::default()),
        compensation: Compensation::NONE,
        command_converter: Converter::default(),
        displacement_sensor: Converter::default(),
        force_sensor: Converter::default(),
        force_delay_samples: 0,
    };
    let plant = SampledActuator::new(&actuator, RATE_HZ).unwrap();
    let monitor = Monitor::new(MonitorConfig {
        rate_hz: RATE_HZ,
        window_s: 2.0,
        band_hz: Some((0.0, 32.0)),
        estimator: Estimator::LeastSquares,
        data_decimation: 8,
        ..Default::default()
    })
    .unwrap();
    let (mut moved, mut judged) = (plant.state(), monitor.state());
    let tones = [(4.0, 1.1, 0.0), (2.0, 2.7, 0.5), (1.0, 6.3, 1.0), (0.3, 11.9, 2.0)];
    let mut readings = Vec::new();
    for i in 0..seconds * RATE_HZ as usize {
        let t = i as f64 / RATE_HZ;
        let target = 1e-3 * tones.iter().map(|(a, f, phase)| a * (2.0 * PI * f * t + phase).sin()).sum::<f64>();
        let (motion, _) = plant.step(&mut moved, Motion { displacement: target, ..Default::default() });
        readings.extend(monitor.step(&mut judged, &[target], &[motion.displacement]).into_iter().flatten().copied());
    }
    readings
}

fn agree_with_the_core(printed: &str, seconds: usize) {
    let core = readings_of_the_core(seconds);
    let lines = printed_readings(printed);
    // The first window is complete in the third second.
    assert_eq!(lines.len(), seconds - 2, "{printed}");
    for (time_s, amplitude, delay_ms) in lines {
        let reading = core.iter().find(|r| (r.time_s - time_s).abs() < 0.5 / RATE_HZ).expect("a reading of this time");
        let tracking = reading.tracking;
        assert!((tracking.amplitude - amplitude).abs() <= 0.5e-6 + 1e-9, "{time_s} {amplitude} {tracking:?}");
        assert!((1e3 * tracking.delay_s - delay_ms).abs() <= 0.5e-5 + 1e-8, "{time_s} {delay_ms} {tracking:?}");
        assert!((15.0..30.0).contains(&delay_ms));
    }
}

#[test]
fn the_example_runs_in_real_time_and_reads_what_the_core_reads() {
    let program = built("examples/realtime.c", "realtime_shared", &[], &shared_libraries());
    let printed = run(Command::new(program).arg("5"));
    println!("{printed}");
    agree_with_the_core(&printed, 5);
    for line in ["monitor step ", "whole cycle ", "wake-up late "] {
        assert!(printed.lines().any(|l| l.starts_with(line) && l.contains("worst")), "{printed}");
    }
    assert!(printed.lines().any(|l| l.starts_with("missed deadlines: ") && l.contains(" of 5120, ")), "{printed}");
}

#[test]
fn the_example_carries_the_library_within_itself_when_told_so() {
    let program = built("examples/realtime.c", "realtime_static", &[], &static_libraries());
    agree_with_the_core(&run(Command::new(&program).args(["20", "--fast"])), 20);
    let usage = output(Command::new(&program).arg("0"));
    assert_eq!(usage.status.code(), Some(2));
}

#[cfg(target_os = "linux")]
#[test]
fn the_shared_library_shows_the_functions_of_the_header_and_nothing_else() {
    let library = prefix().join("lib").join("librthstrack_c.so");
    let printed = run(Command::new("nm").args(["-D", "--defined-only"]).arg(library));
    let mut shown: Vec<&str> = printed.lines().filter_map(|line| line.split_whitespace().nth(2)).collect();
    let header = fs::read_to_string(here("include/rthstrack.h")).unwrap();
    let code = header.split_once("extern \"C\" {").unwrap().1;
    let declared = |line: &str| -> Option<String> {
        let name = line.split_once('(')?.0.rsplit([' ', '*']).next()?;
        (!line.starts_with(['/', ' ']) && name.starts_with("rthstrack_")).then(|| name.to_owned())
    };
    let mut declared: Vec<String> = code.lines().filter_map(declared).collect();
    shown.sort_unstable();
    declared.sort_unstable();
    assert!(declared.len() > 15);
    assert_eq!(shown, declared);
}

/// There is no other system here to compile for; what is the standard library's goes everywhere.
#[test]
fn core_and_interface_call_no_system_by_name() {
    fn check(folder: &Path) -> usize {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        entries.fold(0, |n, path| {
            if path.is_dir() {
                return n + check(&path);
            }
            let text = fs::read_to_string(&path).unwrap();
            for word in ["std::os::", "libc::", "target_os", "cfg(unix)", "cfg(windows)", "extern \"system\""] {
                assert!(!text.contains(word), "{} has {word}", path.display());
            }
            n + 1
        })
    }
    assert!(check(&here("src")) + check(&here("../core/src")) > 20);
    for manifest in ["Cargo.toml", "../core/Cargo.toml"] {
        assert!(!fs::read_to_string(here(manifest)).unwrap().contains("libc"));
    }
}
