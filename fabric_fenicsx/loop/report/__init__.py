"""What is handed back: report.json, report.html and their figures."""
