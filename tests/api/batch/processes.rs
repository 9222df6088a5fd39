//! `mju_error` inside a step is returned as an error in any thread and never ends the process. No log is written, and
//! dropping a manager frees its memory and ends its threads. The tests run in separate processes.

use super::support::{add_plate, add_walker, bits_of, cfg, sim, wheel};
use kinetoscope::mujoco::{Asset, BUILD_VERSION, Data, Model, SupportedVersion, compile, compile_file};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::drive::table::DriveTable;
use kinetoscope::sim::env::{EnvStatus, SimEnv};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::process::{command, is_child, run, text};
use kinetoscope_testkit::urdf::{TempFiles, joint, link, robot};
use kinetoscope_testkit::worlds::{arm_and_hand, text_robot};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

/// A pile of boxes with too little memory for the solver: MuJoCo stops in the middle of a step with `mju_error`.
fn model_without_memory() -> Model {
    // The boxes start in the air, because the compiler takes a step as well.
    let boxes: String = [0.15, 0.4, 0.65, 0.9]
        .map(|z| format!(r#"<body pos="0.01 0 {z}"><freejoint/><geom type="box" size=".1 .1 .1"/></body>"#))
        .concat();
    // The size that is too small for a step but large enough for the compiler differs between versions, so it is
    // searched for.
    for i in 0..200 {
        let size = match BUILD_VERSION {
            SupportedVersion::V2 => format!(r#"<size njmax="500" nconmax="100" nstack="{}"/>"#, 1000 + 200 * i),
            SupportedVersion::V4 => format!(r#"<size memory="{}"/>"#, 4096 + 1024 * i),
        };
        let world = format!(r#"<worldbody><geom type="plane" size="1 1 1"/>{boxes}</worldbody>"#);
        let Ok(compiled) = compile(&format!("<mujoco>{size}{world}</mujoco>"), &[]) else { continue };
        let model = compiled.into_model();
        let Ok(mut data) = Data::new(&model) else { continue };
        if (0..100).any(|_| data.step().is_err()) {
            return model;
        }
    }
    panic!("MuJoCo never stops")
}

/// Steps until MuJoCo stops with an error.
fn provoke(model: &Model) {
    let mut data = Data::new(model).unwrap();
    let error = (0..100).find_map(|_| data.step().err()).map(|error| error.to_string());
    let error = error.unwrap_or_else(|| panic!("MuJoCo found the memory enough: {:?}", data.take_warnings()));
    assert!(error.starts_with("MuJoCo stopped: "), "{error}");
    // A reset makes the data usable again.
    data.reset();
    assert!(data.time() == 0.0);
}

#[test]
fn engine_errors_in_threads() {
    let model = model_without_memory();
    provoke(&model);
    let calm = || {
        let mut sim = sim(cfg(4, 2));
        add_walker(&mut sim, "walker", 0.3);
        sim.update(100);
        sim.batch().read(3, bits_of)
    };
    let alone = calm();
    std::thread::scope(|scope| {
        let stepping = scope.spawn(|| (0..4).map(|_| calm()).collect::<Vec<_>>());
        let failing: Vec<_> = (0..4).map(|_| scope.spawn(|| (0..200).for_each(|_| provoke(&model)))).collect();
        failing.into_iter().for_each(|thread| thread.join().unwrap());
        assert!(stepping.join().unwrap().iter().all(|bits| *bits == alone));
    });
}

/// An environment with this little memory never ends the process, and never shows a partial step.
#[test]
fn engine_errors_in_an_environment() {
    let (model, table) = (model_without_memory(), Arc::new(DriveTable::default()));
    let mut env = SimEnv::new(&model, &table).unwrap();
    env.step(100);
    assert_eq!(*env.status(), EnvStatus::Running);
    assert!(env.buffer_growths() > 0);
    let mut roomy = model.buffers();
    (roomy.contacts, roomy.constraints, roomy.arena_bytes) = (1000, 2000, 16 << 20);
    let mut reference = SimEnv::new(&model.with_buffers(roomy), &table).unwrap();
    reference.step(100);
    assert_eq!(bits_of(&env), bits_of(&reference));
}

/// Runs a scenario that must succeed and leave an empty folder; returns its output.
fn scenario(name: &str, done: &str) -> String {
    let dir = tempfile::tempdir().unwrap();
    let output = run(module_path!(), name, dir.path(), &[]);
    let all = format!("{}\n{}", text(&output.stdout), text(&output.stderr));
    assert!(output.status.success() && all.contains(done), "{all}");
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.is_empty(), "{left:?}");
    all
}

#[test]
fn no_log() {
    let all = scenario("scenario_everything_goes_wrong", "it all went wrong as it should");
    for word in ["WARNING", "ERROR", "Press Enter", "MUJOCO_LOG"] {
        assert!(!all.contains(word), "{word}: {all}");
    }
}

/// Divergence, overflow, engine errors, refused models and files.
#[test]
#[ignore = "runs in a process of its own"]
fn scenario_everything_goes_wrong() {
    if !is_child() {
        return;
    }
    let (files, mut sim) = (TempFiles::default(), sim(cfg(4, 2)));
    let robot = sim.add_robot(wheel(&files)).unwrap();
    sim.add_robot(arm_and_hand("sr5")).unwrap();
    add_plate(&mut sim, [14, 0], [1.0, 1.0, 0.1], [0.3, 0.2, 0.1]);
    sim.update(100);
    sim.robot_mut(robot).write_qpos(&array![[f64::MAX]], None, Some(&[EnvId(1)])).unwrap();
    sim.robot_mut(robot).write_qpos(&array![[9e9]], None, Some(&[EnvId(2)])).unwrap();
    sim.update(10);
    assert_eq!(sim.diverged().len(), 2);
    provoke(&model_without_memory());
    for text in ["", "<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>", "<mujoco><nonsense/></mujoco>"] {
        let _ = compile(text, &[]).unwrap_err();
    }
    let model = "<mujoco><asset><mesh file='empty.stl'/></asset></mujoco>";
    for name in ["empty.stl", "model.xml", "", &"n".repeat(999), &"n".repeat(1000)] {
        let asset = Asset { name: name.into(), bytes: Vec::new() };
        let filled = Asset { bytes: vec![0; 10], ..asset.clone() };
        let _ = compile(model, &[asset]).unwrap_err();
        let _ = compile(model, &[filled.clone(), filled]).unwrap_err();
    }
    for path in ["/no/such/file.xml", "", "/", &"p".repeat(5000), "nul\0.xml"] {
        let _ = compile_file(Path::new(path)).unwrap_err();
    }
    drop(sim);
    println!("it all went wrong as it should");
}

/// Resident memory of this process \[bytes\]. Source: proc(5), the second number of `statm`, in pages.
fn resident() -> usize {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
    statm.split_whitespace().nth(1).unwrap().parse::<usize>().unwrap() * 4096
}

/// More environments than fit into a limited address space are an error, not an abort, and the simulation goes on.
/// Linux grants single rows as long as its own memory suffices, so the sum is checked before any row is made.
#[test]
fn too_many_environments() {
    let child = command(module_path!(), "scenario_limited_memory");
    let variables = child.get_envs().filter_map(|(name, value)| Some((name, value?)));
    let output = Command::new("sh")
        .args(["-c", "ulimit -v 1800000 && exec \"$0\" \"$@\""])
        .arg(child.get_program())
        .args(child.get_args())
        .envs(variables)
        .output()
        .unwrap();
    let all = format!("{}\n{}", text(&output.stdout), text(&output.stderr));
    assert!(output.status.success() && all.contains("300000 environments need"), "{all}");
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_limited_memory() {
    if !is_child() {
        return;
    }
    // Above the limit of a process, whatever its memory.
    let refused = SimulationManager::new(cfg(10_000_000, 1));
    assert_error(refused, "Config { field: \"num_envs\"", &["10000000", "at most 1048576 environments"]);
    const ENVS: usize = 300_000;
    let mut sim = sim(cfg(ENVS, 1));
    let chain: String = (0..60)
        .map(|k| {
            let parent = if k == 0 { "base".into() } else { format!("l{}", k - 1) };
            joint(&format!("j{k}"), "continuous", [&parent, &format!("l{k}")], [0.0, 0.0, 0.1], "0 1 0", "")
                + &link(&format!("l{k}"), 1.0, 0.01, [0.0; 3], "")
        })
        .collect();
    let files = TempFiles::default();
    let chain = text_robot(&files, "chain", &robot("chain", &format!("<link name=\"base\"/>{chain}")));
    let error = sim.add_robot(chain).unwrap_err().to_string();
    println!("{error}");
    assert!(error.contains("MiB of memory, which is not available"), "{error}");
    sim.update(1);
    assert_eq!(sim.time().len(), ENVS);
}

fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

#[test]
fn leaks() {
    scenario("scenario_200_managers", "200 managers");
}

/// Resident memory and number of threads while a manager is in use.
fn use_one() -> (usize, usize) {
    let mut sim = sim(cfg(16, 4));
    sim.add_robot(arm_and_hand("sr5")).unwrap();
    sim.update(3);
    assert_eq!(sim.threads(), 4);
    (resident(), threads())
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_200_managers() {
    if !is_child() {
        return;
    }
    let (empty, before) = (resident(), threads());
    // The allocator keeps some of the freed memory: the first twenty managers show how much.
    let first = (0..20).fold((0, 0), |_, _| use_one());
    assert_eq!(first.1, before + 3, "three workers and the caller");
    let one = first.0.saturating_sub(empty);
    // The memory kept by the allocator varies, so the smallest of ten measurements is compared.
    let least = || {
        let used = (0..10).map(|_| {
            (0..10).for_each(|_| _ = use_one());
            resident()
        });
        used.min().unwrap()
    };
    let warm = least();
    let grown = least().saturating_sub(warm);
    // A leak of one environment per manager would be 100 sixteenths of a manager's memory; the allocator's variation
    // was measured as 1.1 times that memory.
    assert!(grown < 2 * one, "{grown} bytes more; one manager takes {one}");
    // A joined thread leaves /proc shortly after, when the kernel has finished with it.
    for _ in 0..200 {
        if threads() == before {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert_eq!(threads(), before);
    println!("200 managers: {grown} bytes more, one takes {one}");
}
