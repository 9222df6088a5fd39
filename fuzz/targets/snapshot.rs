//! Snapshots: the raw bytes, and the same bytes with a correct length and checksum, which any author of a file can add.
#![no_main]

use kinetoscope_fuzz::{accepted, simulation};
use kinetoscope_sim::{RigidObjectCfg, Snapshot};
use sha2::{Digest, Sha256};

/// Length of the checksum at the end of a file \[bytes\].
const CHECKSUM: usize = 32;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    accepted(Snapshot::from_bytes(bytes));
    let mut bytes = bytes.to_vec();
    if bytes.len() < 16 + CHECKSUM {
        return;
    }
    let length = bytes.len();
    bytes[8..16].copy_from_slice(&(length as u64).to_le_bytes());
    let sum = Sha256::digest(&bytes[..length - CHECKSUM]);
    bytes[length - CHECKSUM..].copy_from_slice(&sum);
    let Some(snapshot) = accepted(Snapshot::from_bytes(&bytes)) else { return };
    assert_eq!(snapshot.time().len(), snapshot.len());
    assert_eq!(accepted(Snapshot::from_bytes(&snapshot.to_bytes())).map(|again| again.len()), Some(snapshot.len()));
    let mut sim = simulation();
    sim.add_rigid_object(RigidObjectCfg { uid: "cube".into(), ..RigidObjectCfg::default() }).expect("a cube");
    if accepted(sim.restore(&snapshot, None)).is_some() {
        sim.update(2);
    }
});
