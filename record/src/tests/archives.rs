//! A falling ball, and reading of NumPy archives.

use super::*;

pub(crate) fn falling(num_envs: usize) -> SimulationManager {
    let mut sim = simulation(num_envs);
    let ball = r#"<mujoco><worldbody><body name="ball" pos="0 0 1"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("ball", ball)).unwrap();
    sim
}

/// A member of an archive.
pub(crate) fn member(path: &Path, name: &str) -> Vec<u8> {
    let members = archive::read_all(&std::fs::read(path).unwrap()).unwrap();
    members.into_iter().find(|(known, _)| known == name).unwrap_or_else(|| panic!("no {name}")).1
}

/// An array: type, number of rows and bytes.
pub(crate) fn rows(path: &Path, name: &str) -> (String, usize, Vec<u8>) {
    let member = member(path, &format!("{name}.npy"));
    let (descr, shape, data) = npy::parse(&member).unwrap();
    (descr.to_string(), shape[0], data.to_vec())
}

/// An array of numbers in double precision.
pub(crate) fn numbers_of(path: &Path, name: &str) -> Vec<f64> {
    let (descr, _, data) = rows(path, name);
    assert_eq!(descr, "<f8");
    data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
}
