#!/bin/sh
# Slurm and munge from Debian's packages, where they are not there yet. Needs root and a package source.
set -eu
PATH="$PATH:/usr/sbin:/sbin"
if command -v slurmctld && command -v slurmd && command -v sbatch && command -v munged; then
    exit 0
fi
if [ "$(id -u)" -ne 0 ] || ! command -v apt-get; then
    echo "make cluster-test needs Slurm and munge: run it as root on Debian, or install slurm-wlm and munge before" >&2
    exit 1
fi
apt-get update --quiet
DEBIAN_FRONTEND=noninteractive apt-get install --quiet --yes --no-install-recommends slurm-wlm munge
