"""What a sequence is like: the paper's sequence and flow tables, and more. Numbers, no verdicts."""

from fedora_qa.statistics.collector import StatisticsCollector, WindowStatistics

__all__ = ["StatisticsCollector", "WindowStatistics"]
