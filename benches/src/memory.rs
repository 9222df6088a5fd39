//! Memory per additional environment, with a limit and beside one `mjData`: the growth of resident memory from 64 to 1024
//! environments. Each count runs in a separate process and takes a few steps, because untouched memory is not resident.

use crate::models::{Case, drive_sr5, sr5};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::mujoco::Data;
use std::process::Command;

const FEW: usize = 64;
const MANY: usize = 1024;
/// Target: memory of an additional environment \[KiB\].
const LIMIT: f64 = 8.0;
const STEPS: u32 = 20;
pub(crate) const HUMANOID: &str = "humanoid";
const SR5: &str = "SR5 + hand";
pub(crate) const OURS: &str = "ours";
const BARE: &str = "bare";

pub(crate) fn run(_: &Settings) -> BenchResult<Vec<Row>> {
    let mut rows = Vec::new();
    for case in [HUMANOID, SR5] {
        if case == HUMANOID && Case::humanoid()?.is_none() {
            continue;
        }
        let (ours, bare) = (growth(OURS, case)?, growth(BARE, case)?);
        rows.push(
            Row::new("memory", case, "KiB/env", 1, ours)
                .against("one mjData", bare, bare / ours)
                .with_target_ratio(bare / LIMIT),
        );
    }
    Ok(rows)
}

/// Memory per additional environment \[KiB\].
fn growth(side: &str, case: &str) -> BenchResult<f64> {
    Ok((resident(side, case, MANY)? - resident(side, case, FEW)?) / (MANY - FEW) as f64 / 1024.0)
}

/// Resident memory of a process that holds `envs` environments \[bytes\].
pub(crate) fn resident(side: &str, case: &str, envs: usize) -> BenchResult<f64> {
    let output =
        Command::new(std::env::current_exe()?).args(["--memory-of", side, case, &envs.to_string()]).output()?;
    let text = String::from_utf8(output.stdout)?;
    text.trim().parse().map_err(|_| {
        format!("a process that holds {envs} environments failed: {}", String::from_utf8_lossy(&output.stderr)).into()
    })
}

/// The measured process: creates environments, steps them, prints the resident memory \[bytes\].
pub(crate) fn child(args: &[String]) -> BenchResult<()> {
    let [side, case, envs] = args else { return Err("side, case and number of environments".into()) };
    let envs: usize = envs.parse()?;
    let case_of = |name: &str| -> BenchResult<Case> {
        if name == SR5 { Case::sr5() } else { Case::humanoid()?.ok_or_else(|| "no humanoid".into()) }
    };
    if side == BARE {
        let case = case_of(case)?;
        let mut datas = Vec::new();
        for i in 0..envs {
            let mut data = Data::new(&case.model)?;
            case.write(i, &mut data);
            for _ in 0..STEPS {
                data.step()?;
            }
            datas.push(data);
        }
        print_resident()
    } else if case == SR5 {
        let (mut sim, robot) = sr5(envs, 1)?;
        drive_sr5(&mut sim, robot, true)?;
        sim.update(STEPS);
        print_resident()
    } else {
        let mut batch = case_of(case)?.batch(envs, 1)?;
        batch.step(STEPS);
        print_resident()
    }
}

/// Prints the resident memory; the measured objects must still be alive.
fn print_resident() -> BenchResult<()> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let kib = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix("kB")?.trim().parse::<u64>().ok())
        .ok_or("no VmRSS in /proc/self/status")?;
    println!("{}", kib * 1024);
    Ok(())
}
